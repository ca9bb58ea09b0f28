//! Common Data Representation (OMG DDSI-RTPS 2.5 §10.2), as ROS 2 writes messages: little endian, each number aligned to its size.

/// The bytes before a message: plain CDR, little endian, no options. Alignment counts from after them.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A message that is being written, field by field in the order of its definition.
#[derive(Clone, Debug)]
pub struct Cdr(Vec<u8>);

impl Default for Cdr {
    fn default() -> Self {
        Self(HEADER.to_vec())
    }
}

/// A number with its little-endian bytes.
pub trait Number: Copy {
    /// Those bytes.
    type Bytes: AsRef<[u8]>;

    /// The number as bytes.
    fn bytes(self) -> Self::Bytes;
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Number for $number {
            type Bytes = [u8; size_of::<$number>()];

            fn bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }
        }
    )*};
}
numbers!(u8, i32, u32, u64, f64);

impl Cdr {
    /// Appends a number.
    #[must_use]
    pub fn number<N: Number>(mut self, number: N) -> Self {
        let bytes = number.bytes();
        let size = bytes.as_ref().len();
        let written = self.0.len() - HEADER.len();
        self.0.resize(self.0.len() + written.next_multiple_of(size) - written, 0);
        self.0.extend_from_slice(bytes.as_ref());
        self
    }

    /// Appends numbers, without their count: an array of fixed length.
    #[must_use]
    pub fn array<N: Number>(self, numbers: &[N]) -> Self {
        numbers.iter().fold(self, |cdr, &number| cdr.number(number))
    }

    /// Appends a count and as many numbers.
    #[must_use]
    pub fn sequence<N: Number>(self, numbers: &[N]) -> Self {
        self.count(numbers.len()).array(numbers)
    }

    /// Appends a count and as many bytes.
    #[must_use]
    pub fn bytes(self, bytes: &[u8]) -> Self {
        let mut cdr = self.count(bytes.len());
        cdr.0.extend_from_slice(bytes);
        cdr
    }

    /// Appends a text with its length and a zero byte, which the length counts.
    #[must_use]
    pub fn text(self, text: &str) -> Self {
        let mut cdr = self.count(text.len() + 1);
        cdr.0.extend_from_slice(text.as_bytes());
        cdr.0.push(0);
        cdr
    }

    /// Appends a count and as many parts, each of which `write` appends.
    #[must_use]
    pub fn parts<T>(self, parts: &[T], write: impl Fn(Self, &T) -> Self) -> Self {
        parts.iter().fold(self.count(parts.len()), write)
    }

    /// The whole message.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        self.0
    }

    /// Longer sequences than the format can count do not fit into a message anyway.
    fn count(self, count: usize) -> Self {
        self.number(u32::try_from(count).unwrap_or(u32::MAX))
    }
}

/// The count bytes that follow a `u64` in a message: the one shape that is read back, see [`crate::Event`].
#[must_use]
pub fn number_and_bytes(message: &[u8]) -> Option<(u64, &[u8])> {
    let body = message.strip_prefix(&HEADER)?;
    let (number, rest) = body.split_first_chunk()?;
    let (count, rest) = rest.split_first_chunk()?;
    Some((u64::from_le_bytes(*number), rest.get(..u32::from_le_bytes(*count) as usize)?))
}

/// The bytes of an image in a `sensor_msgs/CompressedImage`: a header, a text, and the bytes.
#[must_use]
pub fn image_bytes(message: &[u8]) -> Option<&[u8]> {
    let body = message.strip_prefix(&HEADER)?;
    let counted = |at: usize| -> Option<(usize, &[u8])> {
        let at = at.next_multiple_of(4);
        let count = u32::from_le_bytes(*body.get(at..)?.first_chunk()?) as usize;
        let from = at + 4;
        Some((from + count, body.get(from..from + count)?))
    };
    // The time stamp of the header takes eight bytes.
    let (after_frame, _) = counted(8)?;
    let (after_format, _) = counted(after_frame)?;
    Some(counted(after_format)?.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_from_after_the_header() {
        let message = Cdr::default().number(1_u8).number(2_u32).text("ab").number(3.0_f64).finish();
        let expected: &[&[u8]] =
            &[&HEADER, &[1, 0, 0, 0], &[2, 0, 0, 0], &[3, 0, 0, 0], b"ab\0", &[0], &3.0_f64.to_le_bytes()];
        assert_eq!(message, expected.concat());
    }

    #[test]
    fn what_is_read_back_is_what_was_written() {
        let event = Cdr::default().number(7_u64).bytes(&[1, 2, 3]).finish();
        assert_eq!(number_and_bytes(&event), Some((7, &[1, 2, 3][..])));
        let image = Cdr::default().number(1_i32).number(2_u32).text("left").text("png").bytes(&[9, 8]).finish();
        assert_eq!(image_bytes(&image), Some(&[9, 8][..]));
        for length in 0..image.len() {
            assert!(image_bytes(&image[..length]).is_none_or(|bytes| bytes.len() < 2));
        }
        assert_eq!(number_and_bytes(&event[..18]), None);
    }
}
