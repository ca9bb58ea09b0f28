//! Where a rig takes orders from other machines. An order costs three questions: for a number, for the order itself with a tag over that number, and,
//! several times a second, for how far it is. A number is good for one order and for a short time, so that an order that was overheard cannot be
//! given again; whoever stops asking is silent, and the rig stops.

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::sync::oneshot::{Receiver, error::TryRecvError};
use vergence_board::{HostClock, fresh_secret, hex};
use vergence_panel::{Remote, Remotes};

use crate::authorisation::Secret;

/// How long a number is good for.
const GOOD_FOR: Duration = Duration::from_secs(5);
/// Numbers that are kept; the oldest is forgotten first.
const NUMBERS: usize = 64;

/// What an operator asks, as JSON such as `{"ask": "number"}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    /// A number for one order.
    Number,
    /// Go to a mode of the rig.
    Mode {
        /// Its name.
        mode: String,
        /// The number that the rig gave.
        number: String,
        /// See [`Secret::tag`].
        tag: String,
    },
    /// How far the order with this number is.
    Progress {
        /// The number.
        number: String,
    },
}

/// What the rig answers, as JSON such as `{"is": "moving"}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "is", rename_all = "snake_case")]
pub enum Answer {
    /// A number for one order.
    Number {
        /// In hexadecimal digits.
        number: String,
    },
    /// The order is accepted and not at its end.
    Moving,
    /// The rig is in the mode.
    Reached,
    /// The rig is not in the mode, and does not go there any more.
    Ended {
        /// A sentence.
        why: String,
    },
    /// Nothing was done.
    Refused {
        /// A sentence.
        why: String,
    },
}

/// Takes the orders for one rig.
pub struct Desk {
    rig: String,
    secret: Secret,
    remotes: Remotes,
    clock: HostClock,
    given_out: VecDeque<(String, Duration)>,
    order: Option<Order>,
}

/// The order that was accepted last.
struct Order {
    number: String,
    state: State,
}

enum State {
    Under(Remote, Receiver<Result<String, String>>),
    Done(Answer),
}

impl Desk {
    /// The desk of `rig`, whose orders `remotes` carry out.
    #[must_use]
    pub fn new(rig: &str, secret: Secret, remotes: Remotes) -> Self {
        let (rig, clock) = (rig.to_owned(), HostClock::start());
        Self { rig, secret, remotes, clock, given_out: VecDeque::new(), order: None }
    }

    /// The answer to a question.
    pub fn answer(&mut self, question: &[u8]) -> Vec<u8> {
        let answer = match serde_json::from_slice(question) {
            Ok(Ask::Number) => self.number(),
            Ok(Ask::Mode { mode, number, tag }) => self.mode(&mode, number, &tag),
            Ok(Ask::Progress { number }) => self.progress(&number),
            Err(error) => refused(&format!("this is no question: {error}")),
        };
        // Text is all that an answer holds.
        serde_json::to_vec(&answer).unwrap_or_default()
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.clock.now().0)
    }

    fn number(&mut self) -> Answer {
        // The public half of a key that is thrown away: nobody can foresee it.
        let Ok(key) = fresh_secret() else { return refused("this computer has no random numbers") };
        let number = hex(&key.public().0[..16]);
        if self.given_out.len() == NUMBERS {
            self.given_out.pop_front();
        }
        self.given_out.push_back((number.clone(), self.now()));
        Answer::Number { number }
    }

    fn mode(&mut self, mode: &str, number: String, tag: &str) -> Answer {
        if !self.secret.approves(tag, &self.rig, &number, mode) {
            return refused("the secret is another one");
        }
        let Some(at) = self.given_out.iter().position(|(given, _)| *given == number) else {
            return refused("the number of this order is used, or was never given out");
        };
        let given = self.given_out.remove(at).map(|(_, given)| given).unwrap_or_default();
        if self.now().saturating_sub(given) > GOOD_FOR {
            return refused("the number of this order is too old");
        }
        match self.remotes.mode(mode) {
            Ok((remote, outcome)) => {
                self.order = Some(Order { number, state: State::Under(remote, outcome) });
                Answer::Moving
            }
            Err(why) => refused(&why),
        }
    }

    fn progress(&mut self, number: &str) -> Answer {
        let Some(order) = self.order.as_mut().filter(|order| order.number == number) else {
            return refused("no such order is under way");
        };
        let outcome = match &mut order.state {
            State::Done(answer) => return answer.clone(),
            State::Under(remote, outcome) => match outcome.try_recv() {
                Err(TryRecvError::Empty) => {
                    remote.beat();
                    return Answer::Moving;
                }
                Err(TryRecvError::Closed) => Answer::Ended { why: "the board is gone".to_owned() },
                Ok(Err(why)) => Answer::Ended { why },
                Ok(Ok(_)) => Answer::Reached,
            },
        };
        if let State::Under(remote, _) = std::mem::replace(&mut order.state, State::Done(outcome.clone())) {
            remote.finish();
        }
        outcome
    }
}

fn refused(why: &str) -> Answer {
    Answer::Refused { why: why.to_owned() }
}
