//! The encoders of an axis beyond their count: counts that are lost, index pulses, and an absolute encoder.

use vergence_control::{As5048a, EncoderKind, IndexEdge, IndexEdges};
use vergence_protocol::EncoderState;

use super::AxisPlant;
use crate::as5048a::As5048aChip;

impl AxisPlant {
    /// Lets the encoder miss so many counts, as at a burst of noise on its lines; negative ones are counted too many.
    pub fn lose_counts(&mut self, counts: i32) {
        self.encoder.lose(counts);
    }

    /// Puts an absolute encoder on the axis.
    pub fn mount(&mut self, magnet: As5048aChip) {
        self.magnet = Some(magnet);
    }

    /// The absolute encoder, to make it fail.
    pub fn magnet_mut(&mut self) -> Option<&mut As5048aChip> {
        self.magnet.as_mut()
    }

    /// Exchanges a frame with the absolute encoder; `None` where there is none.
    pub fn magnet_frame(&mut self, question: u16) -> Option<u16> {
        let load = self.load;
        self.magnet.as_mut().map(|magnet| magnet.frame(question, load))
    }

    /// Reads this kind of encoder from now on, as the native board does.
    pub(crate) fn use_encoder(&mut self, kind: EncoderKind) {
        match kind {
            EncoderKind::Quadrature | EncoderKind::Servo => self.reader = None,
            EncoderKind::As5048a => self.reader = self.reader.or(Some(As5048a::default())),
        }
    }

    /// Asks the absolute encoder for its angle, where it is in use. A line without an encoder is pulled up.
    pub(crate) fn ask_magnet(&mut self) {
        if let Some(mut reader) = self.reader {
            reader.ask(|question| Some(self.magnet_frame(question).unwrap_or(u16::MAX)));
            self.reader = Some(reader);
        }
    }

    /// What the absolute encoder in use says of itself.
    pub(crate) fn encoder_state(&self) -> EncoderState {
        self.reader.map_or(EncoderState::Plain, |reader| reader.state())
    }

    /// Takes the first rise and fall of the index line since the last call.
    pub(crate) fn take_index(&mut self) -> IndexEdges {
        std::mem::take(&mut self.index_edges)
    }

    /// Whether the index line is high where the lines of the encoder show the count `raw`; `None` without an index.
    #[must_use]
    pub fn index_line(&self, raw: i32) -> Option<bool> {
        let [every, width] = self.mechanics.index;
        let scale = self.encoder.scale_at(raw).unwrap_or_else(|| self.scale_reading());
        (every > 0).then(|| scale.rem_euclid(every) < width)
    }

    /// Notes the edges of the index line between the marks `before` and `after` of the scale.
    pub(super) fn pass_index(&mut self, before: i32, after: i32) {
        let [every, width] = self.mechanics.index;
        if every <= 0 || width <= 0 || before == after {
            return;
        }
        let rises = after > before;
        let marks = before.min(after) + 1..=before.max(after);
        // The line changes where the scale reaches a mark on the way up, and leaves it on the way down.
        let mut edges: Vec<_> = marks
            .filter(|mark| [0, width].contains(&mark.rem_euclid(every)))
            .map(|mark| IndexEdge {
                count: self.encoder.raw(if rises { mark } else { mark - 1 }),
                rises: (mark.rem_euclid(every) == 0) == rises,
            })
            .collect();
        if !rises {
            edges.reverse();
        }
        for edge in edges {
            if !self.index_edges.iter().any(|known| known.rises == edge.rises) {
                // There is room for one of each kind.
                let _ = self.index_edges.push(edge);
            }
        }
    }
}
