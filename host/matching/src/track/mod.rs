//! Live matching: points that were matched in one pair are followed to the next.
//!
//! Of a live rig each pair shows nearly what the one before showed. A track is a matched point that is found again: first in the left view,
//! by registration of the left view before (`follow`), then in the right view, from where pose and range predict it. Only where tracks are
//! missing are corners sought and compared (`search`), strip by strip of the views, one to three in each pair; a first pair, or one in which most tracks
//! are lost, is searched as a whole at once. Where there is no time for all points, the first pair is searched in the middle half of its rows, and the
//! next pairs search the rest, strip by strip.
//!
//! What is found this way passes the same tests as what [`GuidedMatcher`] finds in a single pair, and states its errors by the same rules. A wrong match
//! that a single pair shows now and then would be followed for ever, so that tracks pass one test more: they lie on one surface. A track
//! that fails a test makes no point of that pair; after a few such pairs it ends. Both images of a pair are exposed together, so that a point that
//! moves in the scene may be followed like any other.

mod follow;
mod search;
mod spread;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use vergence_vision::{KannalaBrandt, Left, Right, Transform};

use self::follow::followed;
use self::search::{Strip, newly_found};
use self::spread::Cells;
use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::guided::{LEVELS, are_suspiciously_few};
use crate::links::{Compared, Link, Links, agree_on_pose, in_originals, registered, thin};
use crate::match_errors::{FARTHEST_DEPARTURE, state_errors};
use crate::plane::Pyramid;
use crate::pool::in_pool;
use crate::refine::Scratch;
use crate::shared_views::{DENSITY, Density, SharedViews};
use crate::view::Buffers;
use crate::{Grid, GuidedMatcher, ImagePair, MatchError, Matcher, Matches, SharedFrame, UnmatchedReason, ViewPixel};

/// A matcher for pairs that follow one another.
#[derive(Debug)]
pub struct TrackingMatcher {
    /// Searches whole pairs.
    whole: GuidedMatcher,
    /// Keypoints of each view that are sought, strip by strip, where points are few.
    in_strips: usize,
    state: Mutex<State>,
}

/// Keypoints of each view when a whole pair is searched: about half of them become tracks.
const KEYPOINTS: usize = 2000;
/// The same where tracks are few and strips are searched, which takes little time: as many as [`GuidedMatcher`] has of a pair.
const KEYPOINTS_IN_STRIPS: usize = 4000;
/// There are few tracks where less than this part of the largest number is left.
const MANY: f64 = 0.9;
/// The same for very few.
const VERY_FEW: f64 = 0.8;
/// Largest number of tracks.
const MOST: usize = 700;
/// Pixels of a view per radian, unless the images have more: in views of less corners of wide axes are no longer alike. Denser views than the images
/// cost more than they find where the field is whole; where axes are far apart, views of as many pixels are denser.
const LEAST_DENSITY: f64 = 183.0;
/// Pairs in which a track may fail a test one after the other before it ends.
const PATIENCE: u32 = 3;
/// In every so many pairs the windows beside a track are registered: what they show of its surface, and of its errors, stays until then.
const LOOKED_BESIDE: u64 = 4;
/// Departures of these windows, in pixels of the view, from which on they are registered in every pair.
const NEAR_DEPARTURE: f64 = 0.5 * FARTHEST_DEPARTURE;
/// The strips of a first pair that are searched where there is no time for all points: those with the most pixels that both cameras see.
const FIRST: Range<usize> = 3..9;
/// A pair is searched as a whole where less than this part of the tracks is left that the last such search gave.
const FEW: f64 = 0.5;
/// So few tracks are no base for another pair: where a pose was tried that is wrong, the next one may be right.
const FEWEST: usize = 40;

impl Default for TrackingMatcher {
    fn default() -> Self {
        Self { in_strips: KEYPOINTS_IN_STRIPS, ..Self::with_keypoints(KEYPOINTS) }
    }
}

impl TrackingMatcher {
    /// Searches a whole pair as `whole` does; without its oversampling in views that are as dense as the images, or small images enlarged.
    #[must_use]
    pub fn new(whole: GuidedMatcher) -> Self {
        Self { whole, in_strips: whole.keypoints, state: Mutex::default() }
    }

    /// The same with so many keypoints of each view when a whole pair is searched.
    #[must_use]
    pub fn with_keypoints(keypoints: usize) -> Self {
        Self::new(GuidedMatcher { keypoints, oversampling: None })
    }

    /// The number of pairs so far whose views lie in their images as those of the pair before, so that where was not computed anew.
    #[must_use]
    pub fn kept_views(&self) -> u64 {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.buffers.iter().map(Buffers::kept_views).min().unwrap_or_default()
    }
}

impl Matcher for TrackingMatcher {
    fn name(&self) -> &'static str {
        "tracking"
    }

    /// Finds the matches of a pair that was exposed after those before it. A pair of other cameras begins anew.
    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        self.find_at_most(pair, None)
    }

    fn most_points(&self) -> Option<usize> {
        Some(MOST)
    }

    /// As [`Self::find`]; at most `most` points are followed, and so many fewer corners are sought.
    fn find_at_most(&self, pair: &ImagePair<'_>, most: Option<usize>) -> Result<Matches, MatchError> {
        pair.check()?;
        let most = most.unwrap_or(MOST).min(MOST);
        // A poisoned lock only means that another thread panicked; the tracks are replaced whole.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let oversampling = self.whole.oversampling.unwrap_or(LEAST_DENSITY / density).clamp(1.0, 2.0);
        let most_dense = if self.whole.oversampling.is_some() { oversampling } else { DENSITY / density };
        let densities = Density { least: oversampling, most: most_dense.clamp(1.0, 2.0) };
        let [keypoints, in_strips] = [self.whole.keypoints, self.in_strips].map(|keypoints| keypoints * most / MOST);
        let (state, whole) = (&mut *state, GuidedMatcher { oversampling: Some(oversampling), keypoints });
        // The lock is taken outside of the pool, where no thread that waits begins another pair.
        in_pool(|| state.find(pair, (&whole, densities), [in_strips, most]))
    }
}

/// What is kept from pair to pair.
#[derive(Debug, Default)]
struct State {
    before: Option<Before>,
    /// Number of the next track.
    next: u64,
    /// Number of the pair.
    pair: u64,
    /// Number of the next strip to be searched.
    strip: usize,
    /// Number of tracks that the last search of a whole pair gave.
    at_first: usize,
    /// Of the left and of the right camera.
    buffers: [Buffers; 2],
}

/// The pair before.
#[derive(Debug)]
struct Before {
    cameras: [KannalaBrandt; 2],
    /// For which the grid was made.
    pose: Transform<Left, Right>,
    grid: Grid,
    frame: SharedFrame,
    left: Pyramid,
    /// In the order of their numbers.
    tracks: Vec<Track>,
}

/// A point that is followed.
#[derive(Clone, Copy, Debug)]
struct Track {
    number: u64,
    /// Its place in the left view.
    at: ViewPixel,
    /// From there to its place in the right view.
    moved: [f64; 2],
    /// Pairs in which it failed a test since it last passed them all.
    missed: u32,
    /// What the windows beside it showed when they were registered last.
    departures: Option<[f64; 4]>,
}

/// The views of a pair, smoothed.
struct Seen<'a> {
    views: SharedViews<'a>,
    left: Pyramid,
    right: Pyramid,
    band: EpipolarBand,
}

impl State {
    /// At most `most` points are followed; where they are few, `in_strips` keypoints are sought in the strips of a whole view.
    fn find(
        &mut self,
        pair: &ImagePair<'_>,
        (whole, density): (&GuidedMatcher, Density),
        [in_strips, most]: [usize; 2],
    ) -> Result<Matches, MatchError> {
        self.pair += 1;
        let cameras = [*pair.left_camera, *pair.right_camera];
        let mut before = self.before.take().filter(|before| before.cameras == cameras);
        let kept = before.as_ref().filter(|before| is_near(&before.pose, &pair.left_from_right));
        let (grid, pose) =
            kept.map_or((None, pair.left_from_right), |before| (Some((before.grid, before.frame)), before.pose));
        let views = SharedViews::in_buffers(pair, density, grid, &mut self.buffers)?;
        let [of_left, of_right] = &mut self.buffers;
        let (left, right) = rayon::join(
            || Pyramid::in_buffers(views.left.plane(), LEVELS, &mut of_left.values),
            || Pyramid::in_buffers(views.right.plane(), LEVELS, &mut of_right.values),
        );
        let seen = Seen { band: views.band(), views, left, right };
        let cells = Cells::for_points(most, seen.views.grid.size());
        before.iter_mut().for_each(|before| cells.thin(&mut before.tracks, most));
        let (tracks, links) = before.as_ref().map_or_else(Default::default, |before| followed(before, &seen));
        let are_too_few = (tracks.len() as f64) < (FEW * self.at_first.min(most) as f64).max(FEWEST as f64);
        let strips = match tracks.len() as f64 / most as f64 {
            ..VERY_FEW => 3,
            ..MANY => 2,
            _ => 1,
        };
        let is_bounded = before.is_none() && most < MOST;
        if is_bounded {
            self.strip = FIRST.start;
        }
        let strips = if is_bounded { FIRST.len() } else { strips };
        let strip = self.next_strip(&seen.views.grid, are_too_few && !is_bounded, strips);
        let keypoints = if strips > 1 && !strip.is_whole { in_strips } else { whole.keypoints };
        let (matches, tracks) = self.matched(&seen, (tracks, links), &strip, [keypoints, most]);
        if strip.is_whole || is_bounded {
            self.at_first = tracks.len();
        }
        before.into_iter().for_each(|before| before.left.recycle(&mut self.buffers[0].values));
        let Seen { views, left, right, .. } = seen;
        let (grid, frame) = (views.grid, views.frame);
        right.recycle(&mut self.buffers[1].values);
        views.recycle(&mut self.buffers);
        if strip.is_whole && are_suspiciously_few(&matches) {
            left.recycle(&mut self.buffers[0].values);
            return whole.find(pair);
        }
        self.before = Some(Before { cameras, pose, grid, frame, left, tracks });
        Ok(matches)
    }

    /// Whether the windows beside a track are registered in this pair: in one pair of some, and in each where they departed or a test was failed.
    fn is_due(&self, track: &Track) -> bool {
        let are_near = track.departures.is_some_and(|departures| depart(departures) < NEAR_DEPARTURE);
        !are_near || track.missed > 0 || (self.pair + track.number).is_multiple_of(LOOKED_BESIDE)
    }

    /// The rows in which new tracks are sought: all, or those of the next `count` strips.
    fn next_strip(&mut self, grid: &Grid, is_whole: bool, count: usize) -> Strip {
        let height = grid.size().1;
        let strip = if is_whole { Strip::whole(height) } else { Strip::new(self.strip..self.strip + count, height) };
        self.strip = if is_whole || self.strip + count >= Strip::COUNT { 0 } else { self.strip + count };
        strip
    }

    /// Matches what is newly found, and applies all tests to that and to the links of the tracks. The tracks that go on are returned too.
    fn matched(
        &mut self,
        seen: &Seen<'_>,
        (mut tracks, links): (Vec<Track>, Links),
        strip: &Strip,
        [keypoints, most]: [usize; 2],
    ) -> (Matches, Vec<Track>) {
        let (new, right_keypoints) =
            if tracks.len() < most { newly_found(seen, &tracks, strip, keypoints) } else { (Vec::new(), 0) };
        let known = tracks.len();
        let followed = tracks.iter().map(|track| Keypoint { at: track.at, level: 0 });
        let keypoints: Vec<Keypoint> = followed.chain(new.iter().map(|(keypoint, _)| *keypoint)).collect();
        let compared = Compared {
            left: &seen.left,
            right: &seen.right,
            keypoints: &keypoints,
            oversampling: seen.views.oversampling(),
        };
        let of_tracks = links.into_par_iter().zip(&tracks).map(|(link, track)| {
            let departures = track.departures.filter(|_| !self.is_due(track));
            link.map(|link| Link { departures, ..link })
        });
        let of_new = new.par_iter().map_init(Scratch::new, |scratch, (keypoint, link)| {
            let place = (keypoint.at, keypoint.level);
            let mut from = |link: Link| registered(scratch, &compared, place, link.right, &seen.band);
            link.and_then(|link| from(link).map_err(|failed| failed.reason))
        });
        let mut links: Links = of_tracks.chain(of_new).collect();
        agree_on_pose(&mut links, &keypoints, &seen.views.grid, seen.views.pose_sigma());
        strip.drop_repeated(&mut links, &compared, &seen.band);
        thin(&mut links, &keypoints);
        state_errors(&mut links, &compared, &seen.band);
        for link in &mut links[..known] {
            *link = link.and_then(|it| if is_on_one_surface(&it) { Ok(it) } else { Err(UnmatchedReason::TwoSurfaces) });
        }
        for (track, link) in tracks.iter_mut().zip(&mut links) {
            track.missed = if link.is_ok() { 0 } else { track.missed + 1 };
            if let Ok(link) = link {
                track.moved = [link.right.x - track.at.x, link.right.y - track.at.y];
                track.departures = link.departures;
                link.track = Some(track.number);
            }
        }
        let ended = |reason: &UnmatchedReason| matches!(reason, UnmatchedReason::Duplicate | UnmatchedReason::Repeated);
        let mut ends = links.iter().map(|link| link.as_ref().err().is_some_and(ended));
        tracks.retain(|track| !ends.next().unwrap_or_default() && track.missed < PATIENCE);
        let cells = Cells::for_points(most, seen.views.grid.size());
        self.begin(&mut tracks, (&mut links, known), &compared, (cells, most));
        let right_keypoints = right_keypoints + known;
        (in_originals(&links, &seen.views, &keypoints, right_keypoints), tracks)
    }

    /// Begins tracks with those links from `first` on that are on one surface, as long as there is room: where there are few, and in each place
    /// with the most probable first.
    fn begin(
        &mut self,
        tracks: &mut Vec<Track>,
        (links, first): (&mut Links, usize),
        compared: &Compared<'_>,
        (cells, most): (Cells, usize),
    ) {
        let mut found: Vec<(usize, ViewPixel, Link)> = (first..links.len())
            .filter_map(|index| {
                Some((index, compared.keypoints[index].at, links[index].ok().filter(is_on_one_surface)?))
            })
            .collect();
        found.sort_by(|(.., one), (.., other)| other.right_probability.total_cmp(&one.right_probability));
        let places: Vec<ViewPixel> = found.iter().map(|(_, at, _)| *at).collect();
        let room = most.saturating_sub(tracks.len());
        let chosen = cells.choose(&places, tracks.iter().map(|track| track.at), room);
        for chosen in chosen {
            let (index, at, Link { right, departures, .. }) = found[chosen];
            if let Ok(link) = &mut links[index] {
                link.track = Some(self.next);
            }
            let moved = [right.x - at.x, right.y - at.y];
            tracks.push(Track { number: self.next, at, moved, missed: 0, departures });
            self.next += 1;
        }
    }
}

/// Whether the windows to the left and to the right of a link show the surface of its own.
///
/// A corner at the outline of an object is found some pixels beside it as well, where the image shows the background, and its window finds the
/// disparity of the object. Such a match is wrong, and passes the tests of a single pair now and then: a track of it would pass them again and again.
fn is_on_one_surface(link: &Link) -> bool {
    link.departures.is_some_and(|departures| depart(departures) < FARTHEST_DEPARTURE)
}

/// The larger departure of the windows to the left and to the right.
fn depart([left, right, ..]: [f64; 4]) -> f64 {
    left.max(right)
}

/// Whether the grid of one pose serves another: it is a degree wider than the field.
fn is_near(one: &Transform<Left, Right>, other: &Transform<Left, Right>) -> bool {
    /// In radians, and as a part of the baseline.
    const NEAR: f64 = 0.004;
    let (there, here) = (one.origin().mm(), other.origin().mm());
    one.rotation().angle_to(&other.rotation()) < NEAR && (there - here).norm() < NEAR * there.norm()
}

#[cfg(test)]
mod tests;
