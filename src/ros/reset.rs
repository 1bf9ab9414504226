//! `~/reset`: discards the track and the last attitude.

use smol::channel::{Receiver, bounded};

use super::messages::{TriggerRequest, TriggerResponse};
use super::participant::{EndpointError, RosNode};
use super::service::Service;

/// The service, open and answering until it is closed.
pub struct ResetService(smol::Task<()>);

impl ResetService {
    /// Opens the service, and returns what brings its requests.
    ///
    /// # Errors
    /// [`EndpointError`] when the middleware refuses.
    pub fn open(ros: &mut RosNode) -> Result<(Self, Receiver<()>), EndpointError> {
        let (requests, resets) = bounded(1);
        let serve = Service::of_node(
            ros,
            "reset",
            ("std_srvs", "Trigger"),
            move |_: TriggerRequest| {
                // Before the answer: a frame sent after it finds the request waiting, and resets come before
                // frames. A full channel holds a request that will do.
                let _ = requests.try_send(());
                std::future::ready(TriggerResponse {
                    success: true,
                    message:
                        "the track and the last attitude are forgotten: the next frame is the first"
                            .to_owned(),
                })
            },
        )?;
        Ok((Self(smol::spawn(serve)), resets))
    }

    /// Ends the service, which has to be gone before the node is.
    pub fn close(self) {
        smol::block_on(self.0.cancel());
    }
}
