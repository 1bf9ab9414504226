//! Services whose replies arrive, however long they are.
//!
//! A reply carries the identity of its request in front of its data. `RustDDS` splits a sample that does
//! not fit the path's MTU, about 1250 bytes of 1500, and writes that identity into the pieces with one byte
//! too many: no other implementation can read them, and the client waits forever. A long reply is therefore
//! sent here as one sample in one UDP datagram, which the network splits and joins below RTPS. A short
//! placeholder, addressed to no client, takes its place in the writer's sequence, so that the writer's own
//! bookkeeping holds.
//!
//! What that costs: a long reply is not repeated when it is lost on the way.
//!
//! Where the identity stands is not part of DDS. Fast DDS has it in the inline `QoS`, beside the data. The ROS layer of
//! Cyclone DDS has 16 bytes in front of the data, which the reply repeats ([`ServiceMapping`]).

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use futures::future::BoxFuture;
use futures::{FutureExt, StreamExt, pin_mut};
use ros2_client::dds::rustdds::bytes::Bytes;
use ros2_client::dds::rustdds::dds::WriteError;
use ros2_client::dds::rustdds::discovery::{DiscoveredReaderData, ReaderProxy};
use ros2_client::dds::rustdds::no_key::{DataWriter, SerializerAdapter};
use ros2_client::dds::rustdds::{
    DomainParticipant, QosPolicies, RTPSEntity, RepresentationIdentifier, SampleIdentity,
    SequenceNumber, Timestamp, TopicKind, WriteOptionsBuilder, serialization,
};
use ros2_client::qos::WhenFull;
use ros2_client::{MessageInfo, RmwRequestId, Subscription};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::environment::ServiceMapping;
use super::once::SaidOnce;
use super::participant::{EndpointError, QosProfile, RosNode, reliable};
use super::rtps::{self, Data, GuidBytes, Packet};

/// Longest reply that is left to `RustDDS`, bytes: below what it sends in one piece where the MTU is 1280,
/// the least of IPv6 and of most tunnels.
const SHORT_BYTES: usize = 1000;
/// Longest reply at all, bytes: what UDP carries, less the headers.
const LONGEST_BYTES: usize = 65_000;
/// How long a reply waits for its client to be discovered: a client may find the service first. As long as
/// that, and no longer, can a client that does not exist hold up the others of one service.
const DISCOVERY: Duration = Duration::from_millis(500);
const POLL: Duration = Duration::from_millis(10);
/// How long a reply may wait for a client that does not acknowledge.
const PATIENCE: Duration = Duration::from_millis(100);
/// As `rmw_qos_profile_services_default` has it.
const SERVICE: QosProfile = reliable(10).reliability_reliable(WhenFull::Wait(PATIENCE));

/// CDR in little endian, before the sample itself.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// One service: its requests come in here, and its replies go out.
pub struct Service<Request> {
    name: String,
    requests: Requests<Request>,
    replies: Replies,
    bad_requests: SaidOnce<()>,
}

/// Requests, by where their identity stands.
enum Requests<Request> {
    Beside(Subscription<Request>),
    InFront(Subscription<Headed<Request>>),
}

/// A request behind its identity: the client's, and the request's number.
#[derive(Deserialize)]
struct Headed<Request> {
    identity: Header,
    request: Request,
}

/// What Cyclone DDS has in front of the data of requests and replies.
type Header = [u64; 2];

/// Whom a reply is for.
#[derive(Debug, Clone, Copy, Default)]
struct Asker {
    id: RmwRequestId,
    header: Option<Header>,
}

impl Asker {
    /// Returns one that no client is, in the same convention.
    fn nobody(self) -> Self {
        Self {
            id: RmwRequestId::default(),
            header: self.header.map(|_| Header::default()),
        }
    }
}

impl<Request: DeserializeOwned + 'static> Service<Request> {
    /// Returns the service of this absolute name and type, open to clients.
    ///
    /// # Errors
    /// [`EndpointError::Create`] when the middleware refuses.
    pub fn open(
        ros: &mut RosNode,
        name: &str,
        (package, service_type): (&str, &str),
    ) -> Result<Self, EndpointError> {
        let refused = |source| EndpointError::Create {
            topic: name.to_owned(),
            source,
        };
        let mapping = ros.service_mapping();
        let (node, participant) = ros.parts();
        let qos = QosPolicies::from(&SERVICE);
        let topic = |prefix: &str, part: &str, suffix: &str| {
            participant
                .create_topic(
                    format!("{prefix}{name}{suffix}"),
                    format!("{package}::srv::dds_::{service_type}_{part}_"),
                    &qos,
                    TopicKind::NoKey,
                )
                .map_err(|source| refused(source.into()))
        };
        let reply_topic = topic("rr", "Response", "Reply")?;
        let writer = participant
            .create_publisher(&qos)
            .and_then(|publisher| {
                publisher.create_datawriter_no_key(&reply_topic, Some(qos.clone()))
            })
            .map_err(|source| refused(source.into()))?;
        // Requests last: what arrives can be answered.
        let topic = topic("rq", "Request", "Request")?;
        let requests = match mapping {
            ServiceMapping::Beside => node.create_subscription(&topic, None).map(Requests::Beside),
            ServiceMapping::InFront => node
                .create_subscription(&topic, None)
                .map(Requests::InFront),
        }
        .map_err(refused)?;
        Ok(Self {
            name: name.to_owned(),
            requests,
            replies: Replies {
                writer,
                topic: format!("rr{name}Reply"),
                participant,
                next_sequence_number: 1,
            },
            bad_requests: SaidOnce::default(),
        })
    }

    /// Returns the work of a service `name` below the node's own name: it answers until it is dropped.
    ///
    /// # Errors
    /// [`EndpointError::Create`] when the middleware refuses.
    pub fn of_node<Response, Answer>(
        ros: &mut RosNode,
        name: &str,
        service_type: (&str, &str),
        answer: impl FnMut(Request) -> Answer + Send + 'static,
    ) -> Result<BoxFuture<'static, ()>, EndpointError>
    where
        Request: Send + Sync,
        Response: Serialize + Default + Send + Sync + 'static,
        Answer: Future<Output = Response> + Send + 'static,
    {
        let name = format!("{}/{name}", ros.names().fully_qualified());
        Ok(Self::open(ros, &name, service_type)?.serve(answer).boxed())
    }

    /// Answers every request, one after the other, for ever.
    pub async fn serve<Response, Answer>(self, mut answer: impl FnMut(Request) -> Answer)
    where
        Response: Serialize + Default,
        Answer: Future<Output = Response>,
    {
        let Self {
            name,
            requests,
            mut replies,
            mut bad_requests,
        } = self;
        let requests = match &requests {
            Requests::Beside(requests) => requests
                .async_stream()
                .map(|taken| taken.map(|(request, info)| (None, request, info)))
                .left_stream(),
            Requests::InFront(requests) => requests
                .async_stream()
                .map(|taken| {
                    taken.map(|(headed, info)| (Some(headed.identity), headed.request, info))
                })
                .right_stream(),
        };
        pin_mut!(requests);
        loop {
            match requests.select_next_some().await {
                Ok((header, request, info)) => {
                    let id = identity(&info);
                    let response = answer(request).await;
                    if let Err(error) = replies.send(Asker { id, header }, &response).await {
                        log::warn!("service {name}: {error}");
                    }
                }
                Err(error) => {
                    if bad_requests.fault((), Instant::now()) {
                        log::warn!("service {name}: cannot decode a request: {error}");
                    }
                }
            }
        }
    }
}

/// Returns what a reply says it answers. Fast DDS names the client's reader, and leaves the number of the
/// request to the sample itself.
fn identity(info: &MessageInfo) -> RmwRequestId {
    let own = RmwRequestId {
        writer_gid: info.publisher_gid(),
        sequence_number: info.sequence_number(),
    };
    match info.related_request_id() {
        None => own,
        Some(related) if related.sequence_number == i64::from(SequenceNumber::UNKNOWN) => {
            RmwRequestId {
                sequence_number: own.sequence_number,
                ..related
            }
        }
        Some(related) => related,
    }
}

/// Why a reply was not sent as it is.
#[derive(Debug, thiserror::Error)]
enum ReplyError {
    #[error("a reply cannot be encoded: {0}")]
    Encode(String),
    #[error(
        "a reply of {length} bytes is too long, at most {LONGEST_BYTES} can be sent: an empty one was; \
         ask for fewer parameters at a time"
    )]
    TooLong { length: usize },
    #[error("a reply was not accepted by the middleware: {0}")]
    Write(String),
    #[error("a reply of {length} bytes was not sent: {reason}")]
    Datagram { length: usize, reason: String },
}

struct Replies {
    writer: DataWriter<Vec<u8>, Encoded>,
    topic: String,
    participant: DomainParticipant,
    next_sequence_number: i64,
}

impl Replies {
    async fn send<Response: Serialize + Default>(
        &mut self,
        asker: Asker,
        response: &Response,
    ) -> Result<(), ReplyError> {
        let payload = encode(asker.header, response)?;
        let length = payload.len();
        let readers = self.readers_of(asker.id).await;
        if length <= SHORT_BYTES {
            return self.write(asker.id, payload).await;
        }
        let nothing = Response::default();
        if length > LONGEST_BYTES {
            let payload = encode(asker.header, &nothing)?;
            self.write(asker.id, payload).await?;
            return Err(ReplyError::TooLong { length });
        }
        let sent = self.send_datagrams(asker.id, &readers, &payload);
        let nobody = asker.nobody();
        self.write(nobody.id, encode(nobody.header, &nothing)?)
            .await?;
        sent.map_err(|reason| ReplyError::Datagram { length, reason })
    }

    async fn write(&mut self, request: RmwRequestId, payload: Vec<u8>) -> Result<(), ReplyError> {
        let options = WriteOptionsBuilder::new()
            .source_timestamp(Timestamp::now())
            .related_sample_identity(SampleIdentity::from(request))
            .build();
        let written = self
            .writer
            .async_write_with_options(payload, options)
            .await
            .map_err(|error: WriteError<_>| ReplyError::Write(error.forget_data().to_string()))?;
        self.next_sequence_number = i64::from(written.sequence_number) + 1;
        Ok(())
    }

    /// Returns the readers that the client's participant has on the topic, or none after a while. Those
    /// that did not ask know by the identity that a reply is not for them.
    async fn readers_of(&self, request: RmwRequestId) -> Vec<ReaderProxy> {
        let client = request.writer_gid.to_bytes16();
        let is_of_client = |reader: &DiscoveredReaderData| {
            let guid = reader.reader_proxy.remote_reader_guid.to_bytes();
            guid[..12] == client[..12] && *reader.subscription_topic_data.topic_name() == self.topic
        };
        let begin = Instant::now();
        let mut waited = false;
        loop {
            let mut readers = self.participant.discovered_readers();
            readers.retain(is_of_client);
            let found = !readers.is_empty();
            if found || begin.elapsed() > DISCOVERY {
                if found && waited {
                    // The writer hears of a reader a little after the graph does.
                    smol::Timer::after(POLL).await;
                }
                return readers.into_iter().map(|r| r.reader_proxy).collect();
            }
            waited = true;
            smol::Timer::after(POLL).await;
        }
    }

    fn send_datagrams(
        &self,
        request: RmwRequestId,
        readers: &[ReaderProxy],
        payload: &[u8],
    ) -> Result<(), String> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).map_err(|e| e.to_string())?;
        let mut sent = false;
        let mut failure = "the client is not in the graph, or has no IPv4 address".to_owned();
        for reader in readers {
            let guid = reader.remote_reader_guid.to_bytes();
            let packet = self.packet(request, guid, payload);
            for locator in &reader.unicast_locator_list {
                let address = SocketAddr::from(*locator);
                if !locator.is_udp() || !address.is_ipv4() {
                    continue;
                }
                match socket.send_to(&packet, address) {
                    Ok(_) => sent = true,
                    Err(error) => failure = format!("{address}: {error}"),
                }
            }
        }
        if sent { Ok(()) } else { Err(failure) }
    }

    fn packet(&self, request: RmwRequestId, reader: GuidBytes, payload: &[u8]) -> Vec<u8> {
        let writer = self.writer.guid().to_bytes();
        let mut identity = request.writer_gid.to_bytes16().to_vec();
        identity.extend(rtps::sequence_number(request.sequence_number));
        let now = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let entity = |guid: GuidBytes| [guid[12], guid[13], guid[14], guid[15]];
        Packet::from_participant(&writer)
            .to_participant(&reader)
            .written_at(
                u32::try_from(now.as_secs()).unwrap_or(u32::MAX),
                now.subsec_nanos(),
            )
            .data(&Data {
                reader: entity(reader),
                writer: entity(writer),
                sequence_number: self.next_sequence_number,
                inline_qos: &[
                    (rtps::RELATED_SAMPLE_IDENTITY, &identity),
                    (rtps::RELATED_SAMPLE_IDENTITY_OF_OLD, &identity),
                ],
                payload: Some(&[&ENCAPSULATION, payload].concat()),
            })
            .into_bytes()
    }
}

fn encode<T: Serialize>(header: Option<Header>, value: &T) -> Result<Vec<u8>, ReplyError> {
    let mut bytes = Vec::new();
    let encoding = Encoded::output_encoding();
    // The alignment of what follows 16 bytes is that of what stands alone.
    header
        .map_or(Ok(()), |header| {
            serialization::to_writer_with_rep_id(&mut bytes, &header, encoding)
        })
        .and_then(|()| serialization::to_writer_with_rep_id(&mut bytes, value, encoding))
        .map_err(|error| ReplyError::Encode(error.to_string()))?;
    Ok(bytes)
}

/// Samples that are CDR already.
struct Encoded;

impl SerializerAdapter<Vec<u8>> for Encoded {
    type Error = std::convert::Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Vec<u8>) -> Result<Bytes, Self::Error> {
        Ok(Bytes::copy_from_slice(value))
    }
}
