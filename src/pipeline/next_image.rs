//! The stamp of the image for which a prediction is needed: the one whose camera info has arrived, or the next one by
//! the period.

use super::Stamp;
use super::checks::check_stamp;

/// ns; frames that are farther apart do not determine a period.
const MAX_PERIOD_NS: i64 = 1_000_000_000;

/// The latest stamps. No clock is read: a stamp comes with a camera info or with detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NextImage {
    info: Option<Stamp>,
    frame: Option<Stamp>,
}

impl NextImage {
    /// Takes the stamp of a camera info and returns it as that of its image. `None` if it is not valid, or is the last
    /// one again, as from a driver that repeats its calibration.
    pub fn on_camera_info(&mut self, stamp: Stamp) -> Option<Stamp> {
        check_stamp(stamp).ok()?;
        let is_new = self.info.replace(stamp) != Some(stamp);
        is_new.then_some(stamp)
    }

    /// Takes the stamp of a frame of detections and returns that of the next image, one period later. `None` if camera
    /// infos come with the images, or the period is unknown.
    pub fn on_detections(&mut self, stamp: Stamp) -> Option<Stamp> {
        check_stamp(stamp).ok()?;
        let last = self.frame.replace(stamp)?;
        if self.info.is_some_and(|info| info >= stamp) {
            return None;
        }
        let period_ns = stamp.nanoseconds() - last.nanoseconds();
        if !(1..=MAX_PERIOD_NS).contains(&period_ns) {
            return None;
        }
        Stamp::from_nanoseconds(stamp.nanoseconds() + period_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(sec: i32, nanosec: u32) -> Stamp {
        Stamp { sec, nanosec }
    }

    #[test]
    fn each_camera_info_asks_for_its_own_image_once() {
        let mut next = NextImage::default();
        assert_eq!(next.on_camera_info(at(5, 1)), Some(at(5, 1)));
        assert_eq!(next.on_camera_info(at(5, 1)), None);
        assert_eq!(next.on_camera_info(at(0, 0)), None);
        // A bag that restarts.
        assert_eq!(next.on_camera_info(at(4, 0)), Some(at(4, 0)));
    }

    #[test]
    fn detections_ask_only_where_camera_infos_do_not_come_with_the_images() {
        let mut next = NextImage::default();
        next.on_camera_info(at(5, 0));
        assert_eq!(next.on_detections(at(5, 0)), None);
        next.on_camera_info(at(5, 900_000_000));
        assert_eq!(next.on_detections(at(5, 900_000_000)), None);
        assert_eq!(
            next.on_detections(at(6, 800_000_000)),
            Some(at(7, 700_000_000))
        );
        // Detections that took longer than a period.
        next.on_camera_info(at(8, 0));
        assert_eq!(next.on_detections(at(7, 700_000_000)), None);
    }

    #[test]
    fn without_a_period_there_is_no_next_image() {
        let mut next = NextImage::default();
        assert_eq!(next.on_detections(at(10, 0)), None, "the first");
        assert_eq!(next.on_detections(at(10, 0)), None, "the same");
        assert_eq!(next.on_detections(at(12, 0)), None, "2 s later");
        assert_eq!(next.on_detections(at(11, 0)), None, "earlier");
        assert_eq!(
            next.on_detections(at(11, 50_000_000)),
            Some(at(11, 100_000_000))
        );
        let last = at(i32::MAX, 999_999_999);
        next.on_detections(at(i32::MAX, 500_000_000));
        assert_eq!(next.on_detections(last), None, "no stamp holds it");
    }
}
