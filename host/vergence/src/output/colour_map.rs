//! Colours for numbers.

/// A colour for `share` in [0, 1] on the viridis map (S. van der Walt and N. Smith, 2015), dark blue to yellow:
/// even in lightness and readable without red-green vision.
pub fn viridis(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    let position = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let index = (position as usize).min(STOPS.len() - 2);
    let weight = position - index as f64;
    std::array::from_fn(|channel| {
        let [from, to] = [STOPS[index][channel], STOPS[index + 1][channel]];
        (from + weight * (to - from)).round() as u8
    })
}
