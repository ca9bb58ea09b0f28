//! Which image files of two cameras were taken together: told by their names, numbers or time stamps, never by their order.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::CameraError;

/// Image files of a pair of cameras, paired.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairedFiles {
    /// The left and the right image of each pair, in the order of the left ones.
    pub pairs: Vec<[PathBuf; 2]>,
    /// Images without a partner, the left ones first.
    pub alone: Vec<PathBuf>,
}

/// A number with at least so many digits is a time stamp: milliseconds since 1970 or finer.
const TIME_STAMP_DIGITS: usize = 13;
/// Two exposures belong together if their time stamps differ by less than this part of the time between two images.
const SAME_EXPOSURE: u128 = 4;
/// Words for a camera in the name of a file. Two names that differ only in them are those of a pair.
const SIDES: &[[&str; 2]] =
    &[["left", "right"], ["cam0", "cam1"], ["camera0", "camera1"], ["cam1", "cam2"], ["l", "r"]];

/// Pairs image files. One file of each camera is a pair, whatever its name. Others pair by their time stamps, or by names that
/// are equal or differ only in the word for the camera (left007.png and right007.png), or by the last number in their names.
///
/// # Errors
/// [`CameraError::Unpaired`] where the names say nothing about pairs.
pub fn paired(left: &[PathBuf], right: &[PathBuf]) -> Result<PairedFiles, CameraError> {
    if let ([only_left], [only_right]) = (left, right) {
        return Ok(PairedFiles { pairs: vec![[only_left.clone(), only_right.clone()]], alone: Vec::new() });
    }
    let partners = by_time(left, right)
        .or_else(|| SIDES.iter().find_map(|words| by_key([left, right], |file, side| name_key(file, words[side]))))
        .or_else(|| by_key([left, right], |file, _| last_number(file)))
        .ok_or_else(|| {
            let first = |files: &[PathBuf]| files.first().cloned().unwrap_or_default();
            CameraError::Unpaired { first: [first(left), first(right)], counts: [left.len(), right.len()] }
        })?;
    let alone_left = left.iter().enumerate().filter(|(index, _)| !partners.iter().any(|(of, _)| of == index));
    let alone_right = right.iter().enumerate().filter(|(index, _)| !partners.iter().any(|(_, of)| of == index));
    Ok(PairedFiles {
        alone: alone_left.chain(alone_right).map(|(_, file)| file.clone()).collect(),
        pairs: partners.iter().filter_map(|&(l, r)| Some([left.get(l)?.clone(), right.get(r)?.clone()])).collect(),
    })
}

/// Indices of the left and the right file of each pair.
type Partners = Vec<(usize, usize)>;

/// Files with equal keys are a pair. `None` where a file has no key, two files of a camera have the same, or no key is on both
/// sides.
fn by_key<K: Ord>(files: [&[PathBuf]; 2], key: impl Fn(&Path, usize) -> Option<K>) -> Option<Partners> {
    let keyed = |side: usize| {
        let mut indices = BTreeMap::new();
        for (index, file) in files[side].iter().enumerate() {
            if indices.insert(key(file, side)?, index).is_some() {
                return None;
            }
        }
        Some(indices)
    };
    let (left, right) = (keyed(0)?, keyed(1)?);
    let mut partners: Partners = left.iter().filter_map(|(key, &l)| Some((l, *right.get(key)?))).collect();
    partners.sort_unstable();
    (!partners.is_empty()).then_some(partners)
}

/// The file's name in small letters, without ending, with a gap in place of `word` where that stands alone.
fn name_key(file: &Path, word: &str) -> Option<String> {
    let name = file.file_stem()?.to_string_lossy().to_lowercase();
    let is_apart = |start: usize| {
        let (before, after) = (name[..start].chars().next_back(), name[start + word.len()..].chars().next());
        let is_letter = |c: Option<char>| c.is_some_and(char::is_alphabetic);
        let numbered = word.ends_with(|c: char| c.is_ascii_digit());
        let longer = numbered && after.is_some_and(|c| c.is_ascii_digit());
        !(is_letter(before) || is_letter(after) || longer)
    };
    let place = name.match_indices(word).map(|(start, _)| start).find(|&start| is_apart(start));
    Some(match place {
        Some(start) => format!("{}\0{}", &name[..start], &name[start + word.len()..]),
        None => name,
    })
}

/// The last number in the file's name.
pub fn last_number(file: &Path) -> Option<u64> {
    let stem = file.file_stem()?.to_string_lossy();
    stem.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty())?.parse().ok()
}

/// The exposure time in the file's name: a long integer, or seconds with decimals, in billionths of its unit.
fn time_stamp(file: &Path) -> Option<u128> {
    let stem = file.file_stem()?.to_string_lossy().into_owned();
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if let Some((seconds, decimals)) = stem.split_once('.')
        && is_digits(seconds)
        && is_digits(decimals)
        && decimals.len() <= 9
    {
        return format!("{seconds}{decimals:0<9}").parse().ok();
    }
    let digits = stem.split(|c: char| !c.is_ascii_digit()).find(|digits| digits.len() >= TIME_STAMP_DIGITS)?;
    digits.parse::<u128>().ok()?.checked_mul(1_000_000_000)
}

/// The exposure time in the file's name, from a common start: seconds with decimals, or milliseconds, microseconds or nanoseconds since 1970, which
/// have 13, 16 and 19 digits from the year 2001 to 2286. `None` where its unit cannot be told.
pub fn stamp(file: &Path) -> Option<Duration> {
    let billionths = time_stamp(file)?;
    let units = billionths / 1_000_000_000;
    let per_second = match units.checked_ilog10().map_or(0, |last| last as usize + 1) {
        0..TIME_STAMP_DIGITS => return u64::try_from(billionths).ok().map(Duration::from_nanos),
        13 => 1_000,
        16 => 1_000_000,
        19 => 1_000_000_000,
        _ => return None,
    };
    let nanoseconds = units.checked_mul(1_000_000_000 / per_second)?;
    u64::try_from(nanoseconds).ok().map(Duration::from_nanos)
}

/// Files whose time stamps are nearest to each other are a pair, if they differ by much less than the time between two images.
/// `None` where a file has no time stamp or none agree.
fn by_time(left: &[PathBuf], right: &[PathBuf]) -> Option<Partners> {
    let times = |files: &[PathBuf]| files.iter().map(|file| time_stamp(file)).collect::<Option<Vec<_>>>();
    let (left, right) = (times(left)?, times(right)?);
    let period = shortest_step(&left).into_iter().chain(shortest_step(&right)).min()?;
    let nearest = |time: u128, others: &[u128]| {
        others.iter().enumerate().min_by_key(|(_, other)| other.abs_diff(time)).map(|(index, _)| index)
    };
    let partner = |(index, &time): (usize, &u128)| {
        let partner = nearest(time, &right)?;
        let other = *right.get(partner)?;
        let is_close = other.abs_diff(time).checked_mul(SAME_EXPOSURE)? < period;
        (is_close && nearest(other, &left) == Some(index)).then_some((index, partner))
    };
    let partners: Partners = left.iter().enumerate().filter_map(partner).collect();
    (!partners.is_empty()).then_some(partners)
}

/// The shortest time between two images of a camera.
fn shortest_step(times: &[u128]) -> Option<u128> {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 0).min()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use super::*;

    fn named(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    /// The pairs as `left right`, and the names of those left out.
    fn outcome(left: &[&str], right: &[&str]) -> Option<(Vec<String>, Vec<String>)> {
        let PairedFiles { pairs, alone } = paired(&named(left), &named(right)).ok()?;
        let text = |path: &PathBuf| path.to_string_lossy().into_owned();
        Some((
            pairs.iter().map(|[l, r]| format!("{} {}", text(l), text(r))).collect(),
            alone.iter().map(text).collect(),
        ))
    }

    fn pairs(left: &[&str], right: &[&str], expected: &[&str], alone: &[&str]) {
        let (pairs, left_out) = outcome(left, right).expect("they pair");
        assert_eq!(pairs, expected);
        assert_eq!(left_out, alone);
    }

    #[test]
    fn a_gap_shifts_nothing() {
        pairs(
            &["a/left0.png", "a/left1.png", "a/left3.png"],
            &["b/right0.png", "b/right2.png", "b/right3.png"],
            &["a/left0.png b/right0.png", "a/left3.png b/right3.png"],
            &["a/left1.png", "b/right2.png"],
        );
        // Numbers count as numbers, whatever the words around them.
        pairs(
            &["shot9.png", "shot10.png"],
            &["img010.png", "img011.png"],
            &["shot10.png img010.png"],
            &["shot9.png", "img011.png"],
        );
    }

    #[test]
    fn names_that_differ_in_the_word_for_the_camera_pair() {
        let two = |l: [&str; 2], r: [&str; 2]| {
            pairs(&l, &r, &[&format!("{} {}", l[0], r[0]), &format!("{} {}", l[1], r[1])], &[]);
        };
        two(["1-cam0.png", "2-cam0.png"], ["1-cam1.png", "2-cam1.png"]);
        two(["Hall_L.jpg", "door_L.jpg"], ["Hall_R.jpg", "door_R.jpg"]);
        two(["a.png", "b.png"], ["a.png", "b.png"]);
        two(["left-wall.png", "left-roof.png"], ["right-wall.png", "right-roof.png"]);
    }

    #[test]
    fn time_stamps_pair_within_a_part_of_the_period() {
        pairs(
            &["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"],
            &["1403636579763555999.png", "1403636579863550000.png", "1403636579913555000.png"],
            &["1403636579763555584.png 1403636579763555999.png", "1403636579863555584.png 1403636579863550000.png"],
            &["1403636579813555456.png", "1403636579913555000.png"],
        );
        pairs(
            &["12.5.png", "13.5.png"],
            &["13.51.png", "14.5.png"],
            &["13.5.png 13.51.png"],
            &["12.5.png", "14.5.png"],
        );
    }

    #[test]
    fn names_that_say_nothing_are_refused_even_where_the_counts_agree() {
        assert_eq!(outcome(&["a.png", "b.png"], &["c.png", "d.png"]), None);
        assert_eq!(outcome(&["a.png"], &["c.png", "d.png"]), None);
        assert_eq!(outcome(&["left1.png", "left2.png"], &["right3.png", "right4.png"]), None);
        let error = paired(&named(&["a.png", "b.png"]), &named(&["c.png", "d.png"])).expect_err("no pairs").to_string();
        assert!(error.contains("a.png") && error.contains("c.png") && error.contains("left000.png"), "{error}");
    }

    #[test]
    fn one_file_of_each_camera_is_a_pair() {
        pairs(&["a.png"], &["c.png"], &["a.png c.png"], &[]);
    }
}
