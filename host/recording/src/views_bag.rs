//! A ROS 2 bag with pinhole views of both cameras, for programs that know no fisheye lens.

use std::path::Path;

use image::RgbImage;
use vergence_rig::RigPose;
use vergence_vision::{Face, VirtualView};

use crate::RecordingError;
use crate::bag::{Bag, TRANSFORMS, Topic};
use crate::event::Eye;
use crate::messages::{self, Placed};

macro_rules! topics {
    ($($eye:ident $eye_name:literal $face:ident $face_name:literal)*) => {
        /// The topics of the images of a view, and of its camera.
        const fn topics(eye: Eye, face: Face) -> [Topic; 2] {
            match (eye, face) {
                $((Eye::$eye, Face::$face) => [
                    Topic {
                        name: concat!("/", $eye_name, "/", $face_name, "/image"),
                        kind: "sensor_msgs/msg/Image",
                        definition: include_str!("schemas/Image.msg"),
                    },
                    Topic {
                        name: concat!("/", $eye_name, "/", $face_name, "/camera_info"),
                        kind: "sensor_msgs/msg/CameraInfo",
                        definition: include_str!("schemas/CameraInfo.msg"),
                    },
                ],)*
            }
        }
    };
}
topics! {
    Left "left" Front "front"    Right "right" Front "front"
    Left "left" Left "left"      Right "right" Left "left"
    Left "left" Right "right"    Right "right" Right "right"
    Left "left" Up "up"          Right "right" Up "up"
    Left "left" Down "down"      Right "right" Down "down"
}

/// The frame of a view, such as `left_front`.
fn frame(eye: Eye, face: Face) -> String {
    format!("{}_{}", eye.name(), face.name())
}

/// What a view shows at one exposure.
pub struct Seen<'a> {
    /// The middle of the exposure in nanoseconds since 1970.
    pub stamp_ns: u64,
    /// The camera.
    pub eye: Eye,
    /// Where the view looks.
    pub face: Face,
    /// The view.
    pub view: &'a VirtualView,
    /// The image.
    pub image: &'a RgbImage,
}

/// A bag of views that is being written: `sensor_msgs/Image` and `CameraInfo` for each, and on `/tf` where they are.
pub struct ViewsBag(Bag);

impl ViewsBag {
    /// Begins a bag in `folder`, which must be empty or not there, with the rig file `rig` attached; `simulated` says what of the rig is
    /// simulated.
    ///
    /// # Errors
    /// [`RecordingError::NotEmpty`], [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn create(folder: &Path, rig: &str, simulated: Option<&str>) -> Result<Self, RecordingError> {
        Bag::create(folder, rig, simulated).map(Self)
    }

    /// Appends an image of a view.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn write(&mut self, seen: &Seen<'_>) -> Result<(), RecordingError> {
        let Seen { stamp_ns, eye, face, view, image } = *seen;
        let ([image_topic, info_topic], frame) = (topics(eye, face), frame(eye, face));
        self.0.write(info_topic, stamp_ns, &messages::view_info(stamp_ns, &frame, view))?;
        self.0.write(image_topic, stamp_ns, &messages::raw_image(stamp_ns, &frame, image))
    }

    /// Appends where the views are in their cameras, and where the cameras are, if that is known.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn place<'a>(
        &mut self,
        stamp_ns: u64,
        pose: Option<&RigPose>,
        views: impl IntoIterator<Item = (Eye, Face, &'a VirtualView)>,
    ) -> Result<(), RecordingError> {
        let views = views.into_iter().map(|(eye, face, view)| Placed {
            parent: eye.name().to_owned(),
            child: frame(eye, face),
            pose: *view.camera_from_view().isometry(),
        });
        let frames: Vec<_> = pose.into_iter().flat_map(messages::cameras).chain(views).collect();
        self.0.write(TRANSFORMS, stamp_ns, &messages::placed(stamp_ns, &frames))
    }

    /// Ends the bag.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub fn finish(self) -> Result<(), RecordingError> {
        self.0.finish()
    }
}
