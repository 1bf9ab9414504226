//! The topics of attitudes: the receiver's, of one of two types, and the tanker's.

use std::pin::Pin;

use futures::StreamExt;
use futures::stream::{self, FusedStream};
use ros2_client::{ReadError, Subscription};

use super::messages::{Imu, VehicleAttitude};
use super::output::endpoint;
use super::participant::{EndpointError, RosNode};
use super::topics;
use crate::answering::attitudes::AttitudeMessage;
use crate::config::AttitudeSource;

/// The topic, if there is one.
pub enum AttitudeSubscription {
    /// Nothing needs an attitude.
    None,
    /// `px4_msgs/VehicleAttitude`.
    Px4(Subscription<VehicleAttitude>),
    /// `sensor_msgs/Imu`.
    Imu(Subscription<Imu>),
}

/// The samples, in order; without a topic it never yields.
pub type AttitudeStream<'a> =
    Pin<Box<dyn FusedStream<Item = Result<AttitudeMessage, ReadError>> + 'a>>;

impl AttitudeSubscription {
    /// Returns the subscription to the tanker's attitude, if it is wanted.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn open_tanker(ros: &mut RosNode, is_wanted: bool) -> Result<Self, EndpointError> {
        if !is_wanted {
            return Ok(Self::None);
        }
        let (name, qos) = endpoint(&topics::TANKER_ATTITUDE);
        Ok(Self::Imu(ros.subscription(name, &qos)?))
    }

    /// Returns the subscription to the topic of the receiver's source.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn open(ros: &mut RosNode, source: Option<AttitudeSource>) -> Result<Self, EndpointError> {
        let Some(source) = source else {
            return Ok(Self::None);
        };
        let (name, qos) = endpoint(&source.topic());
        Ok(match source {
            AttitudeSource::Px4 => Self::Px4(ros.subscription(name, &qos)?),
            AttitudeSource::Imu => Self::Imu(ros.subscription(name, &qos)?),
        })
    }

    /// Returns its samples.
    #[must_use]
    pub fn stream(&self) -> AttitudeStream<'_> {
        match self {
            Self::None => Box::pin(stream::pending()),
            Self::Px4(subscription) => {
                let samples = subscription.async_stream();
                Box::pin(samples.map(|sample| Ok(AttitudeMessage::Px4(sample?.0))))
            }
            Self::Imu(subscription) => {
                let samples = subscription.async_stream();
                Box::pin(samples.map(|sample| Ok(AttitudeMessage::Imu(Box::new(sample?.0)))))
            }
        }
    }
}
