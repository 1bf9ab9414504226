//! The real node, in a thread of this process.

use std::thread::JoinHandle;

use smol::channel::{Receiver, Sender};
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::node::{self, NodeError};

use super::error::DemoError;

/// The node while it runs.
pub struct NodeThread {
    stop: Sender<()>,
    ended: Receiver<()>,
    thread: JoinHandle<Result<(), Box<NodeError>>>,
}

impl NodeThread {
    /// Starts the node.
    pub fn start(arguments: Arguments, environment: Environment) -> Result<Self, DemoError> {
        let (stop, stopped) = smol::channel::bounded::<()>(1);
        let (end, ended) = smol::channel::bounded::<()>(1);
        let thread = std::thread::Builder::new()
            .name("node".to_owned())
            .spawn(move || {
                let _end = end; // dropped, it tells that the node has ended
                node::run_until(&arguments, &environment, async move {
                    let _ = stopped.recv().await;
                })
                .map_err(Box::new)
            })
            .map_err(DemoError::Thread)?;
        Ok(Self {
            stop,
            ended,
            thread,
        })
    }

    /// Ends when the node does.
    pub async fn ended(&self) {
        let _ = self.ended.recv().await;
    }

    /// Stops the node, and waits until it has left the graph.
    pub fn stop(self) -> Result<(), DemoError> {
        drop(self.stop);
        match self.thread.join() {
            Ok(result) => result.map_err(DemoError::Node),
            Err(_) => Err(DemoError::NodeGone),
        }
    }
}
