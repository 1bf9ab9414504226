//! The newest samples of a topic when more wait than its depth.
//!
//! `RustDDS` keeps 64 samples of a topic at least, clears them away at every 64th only, and so hands over up to about
//! 128 of them after a pause. What is older than the depth that was asked for is skipped here, and counted.

use std::cell::Cell;
use std::collections::VecDeque;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};

use futures::stream::{FusedStream, Stream};

/// Most samples that are looked at before one is handed over: a flood must not stop the node's loop.
const MOST: usize = 1024;

/// How many samples were skipped since that was asked last.
#[derive(Debug, Clone, Default)]
pub struct Lost(Rc<Cell<u64>>);

impl Lost {
    /// Returns the count, and resets it.
    #[must_use]
    pub fn take(&self) -> u64 {
        self.0.take()
    }

    fn add_one(&self) {
        self.0.set(self.0.get() + 1);
    }
}

/// A topic's samples in their order, the oldest left out when more than `depth` wait.
pub struct Newest<S: Stream> {
    samples: S,
    depth: usize,
    waiting: VecDeque<S::Item>,
    lost: Lost,
}

// The samples that wait are never pinned.
impl<S: Stream + Unpin> Unpin for Newest<S> {}

impl<S: Stream> Newest<S> {
    /// Returns at most the newest `depth` of the samples that wait, and the count of the others.
    pub fn new(samples: S, depth: usize) -> (Self, Lost) {
        let lost = Lost::default();
        let newest = Self {
            samples,
            depth,
            waiting: VecDeque::new(),
            lost: lost.clone(),
        };
        (newest, lost)
    }
}

impl<S: Stream + Unpin> Stream for Newest<S> {
    type Item = S::Item;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<S::Item>> {
        let mut ended = false;
        for _ in 0..MOST {
            match Pin::new(&mut self.samples).poll_next(context) {
                Poll::Ready(Some(sample)) => self.waiting.push_back(sample),
                Poll::Ready(None) => {
                    ended = true;
                    break;
                }
                Poll::Pending => break,
            }
            if self.waiting.len() > self.depth {
                self.waiting.pop_front();
                self.lost.add_one();
            }
        }
        match self.waiting.pop_front() {
            Some(sample) => Poll::Ready(Some(sample)),
            None if ended => Poll::Ready(None),
            None => Poll::Pending,
        }
    }
}

impl<S: FusedStream + Unpin> FusedStream for Newest<S> {
    fn is_terminated(&self) -> bool {
        self.waiting.is_empty() && self.samples.is_terminated()
    }
}

#[cfg(test)]
mod tests {
    use futures::channel::mpsc::unbounded;
    use futures::{FutureExt, StreamExt};

    use super::*;

    #[test]
    fn newest_are_handed_over_in_order_and_the_others_counted() {
        let (sender, samples) = unbounded();
        let (mut newest, lost) = Newest::new(samples, 3);
        let send = |range: std::ops::Range<u32>| {
            for i in range {
                sender.unbounded_send(i).expect("the receiver lives");
            }
        };
        let mut next = || newest.next().now_or_never().flatten();
        assert_eq!(next(), None);
        send(0..3);
        assert_eq!(next(), Some(0));
        assert_eq!(lost.take(), 0, "as many as the depth may wait");
        send(3..10);
        assert_eq!(
            [next(), next(), next(), next()],
            [Some(7), Some(8), Some(9), None]
        );
        assert_eq!(lost.take(), 6);
        assert_eq!(lost.take(), 0, "they are told once");
    }

    #[test]
    fn without_a_limit_nothing_is_lost_and_the_end_comes_last() {
        let (mut newest, lost) = Newest::new(futures::stream::iter(0..100), usize::MAX);
        let all: Vec<i32> = std::iter::from_fn(|| newest.next().now_or_never().flatten()).collect();
        assert_eq!(all, (0..100).collect::<Vec<_>>());
        assert_eq!(lost.take(), 0);
    }

    #[test]
    fn endless_flood_does_not_keep_the_caller() {
        let (mut newest, lost) = Newest::new(futures::stream::repeat(()), 10);
        assert_eq!(newest.next().now_or_never().flatten(), Some(()));
        assert!(lost.take() <= MOST as u64);
    }
}
