//! Recordings of messages: MCAP files and bags of rosbag2, read and written without ROS.
//!
//! ```text
//! reader          a whole recording, its messages in the order of their log times
//! folder          a bag's metadata.yaml
//! mcap_file       one MCAP file: its layout, its blocks, damage
//! sqlite_file     one `SQLite` file of rosbag2
//! damage          what of a recording cannot be read, and why
//! writer          MCAP files; the same messages give the same bytes
//! read_ahead      a recording read by a thread of its own
//! write_behind    a recording written by a thread of its own
//! definitions     of the message types that are written
//! message, cdr    one message, and its bytes <-> the structs of `messages`
//! ```
//!
//! Memory does not grow with a recording's length: of an MCAP file the chunks that overlap in time are held, of an
//! `SQLite` file a batch of rows. What is damaged is named, and the rest is read:
//!
//! ```no_run
//! use tanker_pose::messages::CameraInfo;
//! use tanker_pose::recording::Recording;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! for item in Recording::open("approach".as_ref())? {
//!     match item {
//!         Ok(message) if message.is("/camera_info") => {
//!             let info: CameraInfo = message.decode()?;
//!             println!("{} ns: {} px wide", message.log_time_ns, info.width);
//!         }
//!         Ok(_) => {}
//!         Err(damage) => eprintln!("{damage}"),
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Knows `messages` and `yaml`, and of all floors below `bin` only this and `ros` read and write files; never what the
//! messages mean.

pub mod cdr;
mod damage;
pub mod definitions;
mod folder;
mod mcap_file;
mod message;
mod read_ahead;
mod reader;
mod sqlite_file;
mod write_behind;
mod writer;

pub use damage::{Damage, OpenError};
pub use message::{DecodeError, Definition, RecordedMessage, RecordedTopic, type_name};
pub use read_ahead::ReadAhead;
pub use reader::Recording;
pub use write_behind::WriteBehind;
pub use writer::{Channel, WriteError, Writer};
