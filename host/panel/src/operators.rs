//! Who drives: one page at a time. The others watch, ask for control, and get it when it is handed over or when the driver is gone.

use std::collections::BTreeMap;
use std::time::Duration;

/// A page that drives is silent when nothing was heard from it for this long; it sends a heartbeat several times a second.
pub const LATEST_BEAT: Duration = Duration::from_secs(2);

/// The number of a connected page, from 1; no two pages have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ClientId(pub u64);

/// The outcome of asking for control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// The page drives now.
    Given,
    /// Another page drives, and was asked to hand over.
    Asked,
}

/// The connected pages, and which of them drives. Times are since any fixed instant.
#[derive(Clone, Debug, Default)]
pub struct Operators {
    /// When each page was heard last.
    heard: BTreeMap<ClientId, Duration>,
    driver: Option<ClientId>,
    /// Pages that ask for control, in the order in which they did.
    asking: Vec<ClientId>,
    latest: u64,
}

impl Operators {
    /// A page connected.
    pub fn join(&mut self, now: Duration) -> ClientId {
        self.latest += 1;
        let client = ClientId(self.latest);
        self.heard.insert(client, now);
        client
    }

    /// A page is gone. Whether it was the one that drove: then the rig must stop.
    pub fn leave(&mut self, client: ClientId) -> bool {
        self.heard.remove(&client);
        self.asking.retain(|asking| *asking != client);
        let drove = self.driver == Some(client);
        if drove {
            self.pass_on();
        }
        drove
    }

    /// A page was heard.
    pub fn beat(&mut self, client: ClientId, now: Duration) {
        if let Some(heard) = self.heard.get_mut(&client) {
            *heard = now;
        }
    }

    /// A page wants to drive: it does at once where nobody else drives.
    pub fn take(&mut self, client: ClientId) -> Control {
        match self.driver {
            None => self.driver = Some(client),
            Some(driver) if driver == client => {}
            Some(_) => {
                if !self.asking.contains(&client) {
                    self.asking.push(client);
                }
                return Control::Asked;
            }
        }
        Control::Given
    }

    /// The page that drives hands over to the one that asked first, or to nobody. Whether it drove.
    pub fn hand_over(&mut self, client: ClientId) -> bool {
        let drove = self.driver == Some(client);
        if drove {
            self.pass_on();
        }
        drove
    }

    /// Takes control from a driver that is silent for longer than [`LATEST_BEAT`]. Whether there was one: then the rig must stop.
    pub fn drop_silent(&mut self, now: Duration) -> bool {
        let heard = self.driver.and_then(|driver| self.heard.get(&driver));
        let silent = heard.is_some_and(|heard| now.saturating_sub(*heard) > LATEST_BEAT);
        if silent {
            self.pass_on();
        }
        silent
    }

    fn pass_on(&mut self) {
        self.driver = (!self.asking.is_empty()).then(|| self.asking.remove(0));
    }

    /// The page that drives.
    #[must_use]
    pub fn driver(&self) -> Option<ClientId> {
        self.driver
    }

    /// The pages that ask for control, first come first.
    #[must_use]
    pub fn asking(&self) -> &[ClientId] {
        &self.asking
    }

    /// Number of connected pages.
    #[must_use]
    pub fn count(&self) -> usize {
        self.heard.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(10);

    #[test]
    fn one_page_drives_and_the_other_gets_control_when_it_is_handed_over() {
        let mut operators = Operators::default();
        let [first, second, third] = [0; 3].map(|_| operators.join(NOW));
        assert_eq!(operators.driver(), None, "nobody drives who did not ask");
        assert_eq!(operators.take(first), Control::Given);
        assert_eq!(operators.take(second), Control::Asked);
        assert_eq!(operators.take(third), Control::Asked);
        assert_eq!(operators.take(second), Control::Asked, "asking twice gains nothing");
        assert!(!operators.hand_over(second), "only the driver hands over");
        assert_eq!(operators.driver(), Some(first));
        assert!(operators.hand_over(first));
        assert_eq!((operators.driver(), operators.asking()), (Some(second), &[third][..]));
        assert!(operators.hand_over(second) && operators.hand_over(third));
        assert_eq!(operators.driver(), None);
    }

    #[test]
    fn a_driver_that_leaves_or_is_silent_loses_control_and_a_watcher_that_does_costs_nothing() {
        let mut operators = Operators::default();
        let [first, second] = [0; 2].map(|_| operators.join(NOW));
        operators.take(first);
        assert!(!operators.leave(second));
        let third = operators.join(NOW);
        operators.take(third);
        assert!(operators.leave(first));
        assert_eq!(operators.driver(), Some(third), "who asked gets it");
        assert!(!operators.drop_silent(NOW + LATEST_BEAT));
        let late = NOW + LATEST_BEAT + Duration::from_millis(1);
        operators.beat(third, NOW + Duration::from_millis(1));
        assert!(!operators.drop_silent(late));
        assert!(operators.drop_silent(late + Duration::from_millis(1)));
        assert_eq!((operators.driver(), operators.count()), (None, 1));
        assert!(!operators.drop_silent(late * 2), "without a driver nobody is silent");
    }
}
