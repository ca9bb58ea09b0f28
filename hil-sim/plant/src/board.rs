//! The native board: the controller core, its serial node and the mechanics, run in virtual time.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_control::{
    AxisSettings, BoardSettings, Controller, Delivered, Node, NodeIdentity, SettingsError, TICK_US,
};
use vergence_protocol::management::{NATIVE_HARDWARE, RebootTo};
use vergence_protocol::{ControllerState, MAX_FRAME, Microseconds, PoseReport, ResetCause};

use crate::axis::AxisMechanics;
use crate::bench::bench_settings;
use crate::plant::Plant;
use crate::services::NativeServices;
use crate::servo::{AnyMechanism, ServoBus};

/// A board without hardware, in virtual time: nothing happens between two calls of [`Self::advance`].
#[derive(Debug)]
pub struct NativeBoard {
    node: Node,
    delivered: Delivered,
    services: NativeServices,
    plant: Plant,
    now: Microseconds,
    /// Time until which the next control tick is delayed.
    held_until: Microseconds,
}

impl NativeBoard {
    /// A board that has just been switched on; `seed` decides the positions of the stages.
    ///
    /// # Errors
    /// [`SettingsError`] where an axis cannot work with its settings.
    pub fn new(settings: &[AxisSettings], mechanics: &[AxisMechanics], seed: u64) -> Result<Self, SettingsError> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let positions: Vec<f64> = settings
            .iter()
            .map(|axis| f64::from(axis.min.0) + random.random::<f64>() * f64::from(axis.max.0 - axis.min.0))
            .collect();
        Self::standing_at(settings, mechanics, &positions, random.random())
    }

    /// A board that has just been switched on, with its stages at `positions` (micro-units). `boot` names this start.
    ///
    /// # Errors
    /// [`SettingsError`] where an axis cannot work with its settings.
    pub fn standing_at(
        settings: &[AxisSettings],
        mechanics: &[AxisMechanics],
        positions: &[f64],
        boot: u32,
    ) -> Result<Self, SettingsError> {
        let delivered = Delivered::for_bench(BoardSettings::new(settings)?);
        let mut services = NativeServices::default();
        Ok(Self {
            node: start(&delivered, ResetCause::PowerOn, boot, &mut services)?,
            delivered,
            services,
            plant: Plant::new(mechanics, positions),
            now: Microseconds(0),
            held_until: Microseconds(0),
        })
    }

    /// A robot's board that has just been switched on, with these joints as delivered. `boot` names this start.
    ///
    /// # Errors
    /// [`SettingsError`] where a joint cannot work with its settings.
    pub fn of_joints(
        joints: &[AxisSettings],
        servos: ServoBus<AnyMechanism>,
        boot: u32,
    ) -> Result<Self, SettingsError> {
        let bench = BoardSettings::new(&bench_settings())?;
        let robot = BoardSettings::new(joints)?;
        let delivered = Delivered { machine: robot.machine, bench, robot };
        let mut services = NativeServices::default();
        Ok(Self {
            node: start(&delivered, ResetCause::PowerOn, boot, &mut services)?,
            delivered,
            services,
            plant: Plant::of_joints(servos),
            now: Microseconds(0),
            held_until: Microseconds(0),
        })
    }

    /// Restarts the board in any state: memory is lost, the drivers go off, its clock begins again at zero, and the
    /// mechanics keep their positions. `boot` names this start.
    ///
    /// # Errors
    /// [`SettingsError`], which cannot be where the settings were taken before.
    pub fn restart(&mut self, cause: ResetCause, boot: u32) -> Result<(), SettingsError> {
        self.services.boot();
        self.node = start(&self.delivered, cause, boot, &mut self.services)?;
        self.plant.restart_clock();
        self.now = Microseconds(0);
        self.held_until = Microseconds(0);
        Ok(())
    }

    /// The board's clock.
    #[must_use]
    pub fn now(&self) -> Microseconds {
        self.now
    }

    /// Lets time pass until `to`, running every control tick on its instant.
    pub fn advance(&mut self, to: Microseconds) {
        while self.next_tick() <= to {
            let due = self.node.wakes_at();
            self.now = self.next_tick();
            self.plant.advance(self.now);
            self.tick(due);
        }
        if to > self.now {
            self.plant.advance(to);
            self.now = to;
        }
    }

    /// Runs the control tick that was due at `due`. Ticks keep to whole periods, as those of a board whose timer goes on
    /// whatever the latency: those that a delay has taken are left out.
    fn tick(&mut self, due: Microseconds) {
        let late = self.now.0.saturating_sub(due.0);
        let tick = Microseconds(due.0 + late / TICK_US * TICK_US);
        self.node.allow_delay(tick, late, &mut self.plant);
        self.node.poll(tick, &mut self.plant);
        self.node.plan_at_once();
    }

    /// Delays the next control tick by `us` microseconds.
    pub fn delay_tick(&mut self, us: u64) {
        self.held_until = Microseconds(self.next_tick().0 + us);
    }

    fn next_tick(&self) -> Microseconds {
        self.node.wakes_at().max(self.held_until)
    }

    /// Takes bytes that arrive now.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.node.receive(self.now, bytes, &mut self.plant, &mut self.services);
    }

    /// Takes all frames that leave now, one after the other.
    pub fn transmit(&mut self) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        let mut out = Vec::new();
        while let Some(length) = self.node.transmit(self.now, &mut buffer) {
            out.extend(buffer.iter().take(length));
        }
        out
    }

    /// The restart that the host has asked for, once all frames have left; the caller makes it by [`Self::restart`].
    pub fn take_reboot(&mut self) -> Option<RebootTo> {
        self.node.take_reboot()
    }

    /// Logs as the firmware would.
    pub fn log(&mut self, entry: &[u8]) {
        self.node.log(entry);
    }

    /// The state of the controller.
    #[must_use]
    pub fn state(&self) -> ControllerState {
        self.node.controller().state()
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &Controller {
        self.node.controller()
    }

    /// The pose that the board would report now, with number zero.
    #[must_use]
    pub fn pose(&self) -> PoseReport {
        self.node.controller().pose(self.now, 0, &self.plant)
    }

    /// Flash and boot loader, to change them.
    pub fn services_mut(&mut self) -> &mut NativeServices {
        &mut self.services
    }

    /// The simulated mechanics, which know the true positions.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The mechanics, to change them.
    pub fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}

/// The software as it starts.
fn start(
    delivered: &Delivered,
    reset: ResetCause,
    boot: u32,
    services: &mut NativeServices,
) -> Result<Node, SettingsError> {
    let identity = NodeIdentity {
        board: "native-sim".try_into().unwrap_or_default(),
        hardware: NATIVE_HARDWARE,
        firmware: services.running.version,
        oldest: services.oldest,
        build: services.running.build,
        uid: *b"vergence-sim",
        reset,
    };
    Node::new(delivered, identity, boot, services)
}
