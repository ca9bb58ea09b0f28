//! Points and bearings as tables, for programs: CSV, or JSON with named columns and rows of numbers.

use serde_json::{Value, json};
use vergence_pipeline::{Bearing, ColouredPoint};

/// The format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated, with the names of the columns in the first line.
    Csv,
    /// `{"about", "columns", "rows"}`.
    Json,
}

impl TableFormat {
    /// The ending of a file in this format, without the dot.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json => "json",
        }
    }
}

/// Named columns, and a row of numbers for each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What the rows mean.
    about: &'static str,
    columns: &'static [&'static str],
    rows: Vec<Vec<f64>>,
}

const POINTS: &str = "points in the left camera's frame (x right, y down, z forward), sigma of their distance, score (probability that the \
     match is right: that the distance is off by at most three sigma), covariance (cov), and the part of it from the point's own pixels (own); \
     the rest is shared by all points of the pair: lenses, calibration and encoders; extrapolated is 1 where a lens was not measured; \
     track is the number of a place that is followed from pair to pair, -1 where none is";
const POINT_COLUMNS: [&str; 26] = [
    "x_mm",
    "y_mm",
    "z_mm",
    "red",
    "green",
    "blue",
    "u_left",
    "v_left",
    "u_right",
    "v_right",
    "sigma_range_mm",
    "score",
    "cov_xx_mm2",
    "cov_xy_mm2",
    "cov_xz_mm2",
    "cov_yy_mm2",
    "cov_yz_mm2",
    "cov_zz_mm2",
    "own_xx_mm2",
    "own_xy_mm2",
    "own_xz_mm2",
    "own_yy_mm2",
    "own_yz_mm2",
    "own_zz_mm2",
    "extrapolated",
    "track",
];
const BEARINGS: &str = "directions in the camera's own frame (x right, y down, z forward), of length one: not points; extrapolated is 1 where the \
     lens was not measured";
const BEARING_COLUMNS: [&str; 10] = ["x", "y", "z", "red", "green", "blue", "u", "v", "sigma_deg", "extrapolated"];

/// xx, xy, xz, yy, yz and zz of a symmetric matrix.
pub(super) fn upper_triangle(at: impl Fn((usize, usize)) -> f64) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(at)
}

impl Table {
    /// A row for each point of a cloud.
    #[must_use]
    pub fn of_points(points: &[ColouredPoint]) -> Self {
        let row = |ColouredPoint { point, colour, score, track }: &ColouredPoint| {
            let (at, left, right) = (point.point.mm(), point.pixels.left, point.pixels.right);
            let colour = colour.map(f64::from);
            [
                &[at.x, at.y, at.z][..],
                &colour,
                &[left.u, left.v, right.u, right.v, point.sigma_range.mm(), f64::from(*score)],
                &upper_triangle(|place| point.covariance[place]),
                &upper_triangle(|place| point.own_covariance[place]),
                &[f64::from(u8::from(point.extrapolated)), track.map_or(-1.0, |track| track as f64)],
            ]
            .concat()
        };
        Self { about: POINTS, columns: &POINT_COLUMNS, rows: points.iter().map(row).collect() }
    }

    /// A row for each bearing of one camera.
    #[must_use]
    pub fn of_bearings(bearings: &[Bearing]) -> Self {
        let row = |bearing: &Bearing| {
            let direction = bearing.direction.vector();
            let [red, green, blue] = bearing.colour.map(f64::from);
            let pixel = bearing.pixel;
            let [sigma, extrapolated] = [bearing.sigma.deg(), f64::from(u8::from(bearing.extrapolated))];
            vec![direction.x, direction.y, direction.z, red, green, blue, pixel.u, pixel.v, sigma, extrapolated]
        };
        Self { about: BEARINGS, columns: &BEARING_COLUMNS, rows: bearings.iter().map(row).collect() }
    }

    /// The table in `format`.
    #[must_use]
    pub fn text(&self, format: TableFormat) -> String {
        match format {
            TableFormat::Csv => self.csv(),
            TableFormat::Json => self.json().to_string() + "\n",
        }
    }

    /// A line of names, then a line for each row.
    #[must_use]
    pub fn csv(&self) -> String {
        let lines = self.rows.iter().map(|row| row.iter().map(|&value| number(value)).collect::<Vec<_>>().join(","));
        [self.columns.join(",")].into_iter().chain(lines).map(|line| line + "\n").collect()
    }

    /// `{"about", "columns", "rows"}`.
    #[must_use]
    pub fn json(&self) -> Value {
        let rows: Vec<Vec<f64>> =
            self.rows.iter().map(|row| row.iter().map(|&value| rounded(value)).collect()).collect();
        json!({ "about": self.about, "columns": self.columns, "rows": rows })
    }
}

/// Rounded to six decimals: a nanometre, a micropixel.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn number(value: f64) -> String {
    rounded(value).to_string()
}
