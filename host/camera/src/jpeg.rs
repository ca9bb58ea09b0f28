//! Detects truncated JPEG files, whose missing part decoders fill with grey without an error.

/// Whether a JPEG has its end marker, found by walking the marker segments (ITU-T T.81, annex B). True for bytes of any
/// other format.
#[must_use]
pub fn is_whole(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: u8 = 0xd9;
    let Some(mut rest) = bytes.strip_prefix(&[0xff, 0xd8]) else { return true };
    loop {
        match rest {
            [0xff, END_OF_IMAGE, ..] => return true,
            // Fill bytes, and markers without a length.
            [0xff, 0xff, ..] => rest = rest.get(1..).unwrap_or_default(),
            [0xff, 0x01 | 0xd0..=0xd8, ..] => rest = rest.get(2..).unwrap_or_default(),
            [0xff, marker, high, low, ..] => {
                let length = usize::from(u16::from_be_bytes([*high, *low]));
                let Some(after) = rest.get(2 + length..) else { return false };
                rest = if *marker == START_OF_SCAN { after_scan(after) } else { after };
            }
            _ => return false,
        }
    }
}

/// Bytes after the entropy-coded data, in which 0xff is followed only by zero or by a restart marker.
fn after_scan(bytes: &[u8]) -> &[u8] {
    let ends = |pair: &[u8]| matches!(pair, [0xff, next] if !matches!(next, 0x00 | 0xd0..=0xd7 | 0xff));
    let end = bytes.windows(2).position(ends).unwrap_or(bytes.len());
    bytes.get(end..).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Vec<u8> {
        let image = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * 37 + y * 91) as u8; 3]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Jpeg).expect("a picture");
        bytes.into_inner()
    }

    #[test]
    fn a_jpeg_cut_anywhere_is_not_whole() {
        let whole = picture();
        assert!(is_whole(&whole));
        for length in 2..whole.len() {
            assert!(!is_whole(&whole[..length]), "cut to {length} of {}", whole.len());
        }
    }

    #[test]
    fn what_follows_the_end_does_not_matter_and_other_formats_are_not_judged() {
        let mut padded = picture();
        padded.extend([0; 10]);
        assert!(is_whole(&padded));
        assert!(is_whole(b"\x89PNG"));
    }

    #[test]
    fn a_thumbnail_in_an_application_segment_is_no_end() {
        let whole = picture();
        let mut nested = vec![0xff, 0xd8, 0xff, 0xe1, 0x00, 0x06, 0xff, 0xd8, 0xff, 0xd9];
        nested.extend(&whole[2..whole.len() - 2]);
        assert!(!is_whole(&nested));
        nested.extend([0xff, 0xd9]);
        assert!(is_whole(&nested));
    }
}
