//! A smooth function of the angle to the axis, from its values at equal steps from 0 on.

/// Cubic Hermite interpolation. The derivatives at the steps are differences of fourth order, so that the error falls with the fourth power
/// of the step.
#[derive(Clone, Debug)]
pub struct Curve {
    step: f64,
    values: Vec<f64>,
    /// Derivatives times the step.
    slopes: Vec<f64>,
}

/// How a function continues below 0.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// f(-x) = f(x).
    Even,
    /// f(-x) = -f(x).
    Odd,
}

impl Curve {
    /// Through `values`, at 0, `step`, 2 `step`, ...; at least five of them.
    pub fn new(step: f64, values: Vec<f64>, symmetry: Symmetry) -> Self {
        let last = values.len() as isize - 1;
        let sign = if symmetry == Symmetry::Even { 1.0 } else { -1.0 };
        let at = |index: isize| if index < 0 { sign * values[index.unsigned_abs()] } else { values[index as usize] };
        // J. Stoer and R. Bulirsch, Introduction to Numerical Analysis, section 3.5: differences over five values.
        let slope = |index: isize| {
            let over = |weights: [f64; 5], first: isize| {
                weights.iter().zip(first..).map(|(weight, index)| weight * at(index)).sum::<f64>() / 12.0
            };
            match last - index {
                0 => over([3.0, -16.0, 36.0, -48.0, 25.0], index - 4),
                1 => over([-1.0, 6.0, -18.0, 10.0, 3.0], index - 3),
                _ => over([1.0, -8.0, 0.0, 8.0, -1.0], index - 2),
            }
        };
        let slopes = (0..=last).map(slope).collect();
        Self { step, values, slopes }
    }

    /// The curve through other values at the same steps: `change` is given an argument and the value there.
    pub fn mapped(&self, change: impl Fn(f64, f64) -> f64, symmetry: Symmetry) -> Self {
        let value = |(index, value): (usize, &f64)| change(self.step * index as f64, *value);
        Self::new(self.step, self.values.iter().enumerate().map(value).collect(), symmetry)
    }

    /// The largest argument.
    pub fn end(&self) -> f64 {
        self.step * (self.values.len() - 1) as f64
    }

    /// Value and derivative at `x`. Beyond the ends the last piece goes on.
    pub fn at(&self, x: f64) -> (f64, f64) {
        let index = ((x / self.step).max(0.0) as usize).min(self.values.len() - 2);
        let t = x / self.step - index as f64;
        let (a, b) = (self.values[index], self.values[index + 1]);
        let (p, q) = (self.slopes[index], self.slopes[index + 1]);
        // a + p t + ... in powers of t.
        let (second, third) = (3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q);
        let value = a + t * (p + t * (second + t * third));
        (value, (p + t * (2.0 * second + t * 3.0 * third)) / self.step)
    }

    /// The argument at which a rising curve has the value `y`; `None` outside of its values.
    pub fn argument_of(&self, y: f64) -> Option<f64> {
        let (first, last) = (*self.values.first()?, *self.values.last()?);
        if !(first..=last).contains(&y) {
            return None;
        }
        let above = self.values.partition_point(|value| *value < y).clamp(1, self.values.len() - 1);
        let (low, high) = (self.values[above - 1], self.values[above]);
        let mut x = self.step * ((above - 1) as f64 + (y - low) / (high - low));
        for _ in 0..4 {
            let (value, slope) = self.at(x);
            x -= (value - y) / slope;
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_follows_a_smooth_function_and_its_inverse() {
        let step = 0.005;
        let odd = Curve::new(step, (0..310).map(|i| (step * f64::from(i)).sin()).collect(), Symmetry::Odd);
        let even = Curve::new(step, (0..310).map(|i| (step * f64::from(i)).cos()).collect(), Symmetry::Even);
        for i in 0..1000 {
            let x = odd.end() * f64::from(i) / 999.0;
            assert!((odd.at(x).0 - x.sin()).abs() < 5e-12 && (odd.at(x).1 - x.cos()).abs() < 3e-9, "{x}");
            assert!((even.at(x).0 - x.cos()).abs() < 5e-12 && (even.at(x).1 + x.sin()).abs() < 3e-9, "{x}");
            assert!((odd.argument_of(odd.at(x).0).unwrap() - x).abs() < 1e-9, "{x}");
        }
        assert_eq!((odd.argument_of(-0.1), odd.argument_of(1.1)), (None, None));
    }
}
