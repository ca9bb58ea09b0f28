//! A mechanism whose kind is chosen at run time, so that a board's mechanics need no type parameter for it.

use std::any::Any;
use std::fmt::Debug;

use super::bus::{Mechanism, ServoMoment};

/// Any mechanism.
#[derive(Debug)]
pub struct AnyMechanism(Box<dyn Object>);

impl AnyMechanism {
    /// Takes a mechanism.
    #[must_use]
    pub fn new(mechanism: impl Mechanism + Debug + Send + Sync + 'static) -> Self {
        Self(Box::new(mechanism))
    }

    /// The mechanism itself, if it is of this kind.
    #[must_use]
    pub fn get<M: 'static>(&self) -> Option<&M> {
        self.0.as_any().downcast_ref()
    }

    /// The mechanism itself, if it is of this kind, to change it.
    pub fn get_mut<M: 'static>(&mut self) -> Option<&mut M> {
        self.0.as_any_mut().downcast_mut()
    }
}

impl Clone for AnyMechanism {
    fn clone(&self) -> Self {
        Self(self.0.boxed_clone())
    }
}

impl Mechanism for AnyMechanism {
    fn torques(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]) {
        self.0.push(seconds, outputs, torques);
    }
}

/// [`Mechanism`] without what needs to know its size.
trait Object: Debug + Send + Sync {
    fn push(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]);
    fn boxed_clone(&self) -> Box<dyn Object>;
    fn as_any(&self) -> &dyn Any;
    fn as_any_mut(&mut self) -> &mut dyn Any;
}

impl<M: Mechanism + Debug + Send + Sync + 'static> Object for M {
    fn push(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]) {
        self.torques(seconds, outputs, torques);
    }

    fn boxed_clone(&self) -> Box<dyn Object> {
        Box::new(self.clone())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
