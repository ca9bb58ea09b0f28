//! The camera models of other programs by their names and the names of their parameters, as files of this program hold them.

use std::collections::BTreeMap;

use super::pinhole::NAMES;
use super::{
    CameraModel, Central, DoubleSphere, Eucm, Fisheye624, Formula, Mei, OCam, Pinhole, Radtan, SplineGrid,
    SplinedStereographic,
};
use crate::InvalidLens;

/// Values of parameters by name.
struct Values<'a>(&'a BTreeMap<String, f64>);

/// The model that [`CameraModel::name`] calls `name`, with the values of [`CameraModel::parameters`] by their names.
///
/// # Errors
/// [`InvalidLens`] where there is no such model, where `values` are not exactly its parameters, or where they are those of no camera.
pub fn model_of(name: &str, values: &BTreeMap<String, f64>) -> Result<Box<dyn CameraModel>, InvalidLens> {
    let of = Values(values);
    match name {
        "double sphere" => of.central(of.double_sphere(), "double sphere"),
        "enhanced unified" => of.central(of.eucm(), "enhanced unified"),
        "omnidirectional (Mei)" => of.central(of.mei(), "omnidirectional (Mei)"),
        "FISHEYE624" => of.central(of.fisheye624(), "FISHEYE624"),
        "pinhole" => of.central(of.pinhole_camera(), "pinhole"),
        "splined stereographic" => of.central(of.splined(), "splined stereographic"),
        "OCamCalib" => of.central(of.ocam().transpose()?, "OCamCalib"),
        _ => Err(InvalidLens::UnknownModel),
    }
}

impl Values<'_> {
    /// The camera of `formula`, if that took all values.
    fn central(
        &self,
        formula: Option<impl Formula + 'static>,
        name: &'static str,
    ) -> Result<Box<dyn CameraModel>, InvalidLens> {
        let formula = formula.ok_or(InvalidLens::ModelValues(name))?;
        let taken = formula.parameters();
        let is_all = taken.len() == self.0.len() && taken.iter().all(|one| self.0.get(&one.name) == Some(&one.value));
        if !is_all {
            return Err(InvalidLens::ModelValues(name));
        }
        Ok(Box::new(Central::new(formula)?))
    }

    fn one(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    fn all<const N: usize>(&self, names: [&str; N]) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for (value, name) in values.iter_mut().zip(names) {
            *value = self.one(name)?;
        }
        Some(values)
    }

    fn pinhole(&self) -> Option<[f64; 4]> {
        self.all(["fx", "fy", "cx", "cy"])
    }

    /// Those of the coefficients that are there; the others are zero.
    fn distortion(&self) -> Option<Radtan> {
        Radtan::new(&NAMES.map(|name| self.one(name).unwrap_or_default()))
    }

    /// A count of things, no more than there are values.
    fn count(&self, name: &str) -> Option<usize> {
        let count = self.one(name)?;
        (count.fract() == 0.0 && (0.0..=self.0.len() as f64).contains(&count)).then_some(count as usize)
    }

    fn double_sphere(&self) -> Option<DoubleSphere> {
        let [xi, alpha] = self.all(["xi", "alpha"])?;
        Some(DoubleSphere { pinhole: self.pinhole()?, xi, alpha })
    }

    fn eucm(&self) -> Option<Eucm> {
        let [alpha, beta] = self.all(["alpha", "beta"])?;
        Some(Eucm { pinhole: self.pinhole()?, alpha, beta })
    }

    fn mei(&self) -> Option<Mei> {
        let [skew, xi] = self.all(["skew", "xi"])?;
        Some(Mei { pinhole: self.pinhole()?, skew, xi, distortion: self.distortion()? })
    }

    fn fisheye624(&self) -> Option<Fisheye624> {
        Some(Fisheye624 {
            pinhole: self.pinhole()?,
            radial: self.all(["k0", "k1", "k2", "k3", "k4", "k5"])?,
            tangential: self.all(["p0", "p1"])?,
            prism: self.all(["s0", "s1", "s2", "s3"])?,
        })
    }

    fn pinhole_camera(&self) -> Option<Pinhole> {
        Some(Pinhole { pinhole: self.pinhole()?, distortion: self.distortion()? })
    }

    fn ocam(&self) -> Option<Result<OCam, InvalidLens>> {
        let polynomial: Vec<f64> = (0..self.0.len()).map_while(|index| self.one(&format!("a{index}"))).collect();
        Some(OCam::new(&polynomial, self.all(["row", "column"])?, self.all(["c", "d", "e"])?))
    }

    fn splined(&self) -> Option<SplinedStereographic> {
        let [order, columns, rows] = ["order", "Nx", "Ny"].map(|name| self.count(name));
        let grid = SplineGrid { order: order?, columns: columns?, rows: rows?, field_deg: self.one("fov_x_deg")? };
        let places = (0..grid.rows).flat_map(|row| (0..grid.columns).map(move |column| (row, column)));
        let shift = |(row, column): (usize, usize)| {
            Some([self.one(&format!("dx_{row}_{column}"))?, self.one(&format!("dy_{row}_{column}"))?])
        };
        Some(SplinedStereographic {
            pinhole: self.pinhole()?,
            grid,
            control: places.map(shift).collect::<Option<_>>()?,
        })
    }
}
