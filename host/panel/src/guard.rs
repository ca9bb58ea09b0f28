//! Which connections are let in: any web page that is open in a browser can reach this computer, and must not drive the rig.

/// Who may connect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Pages that this computer loaded from the panel itself.
    ThisComputer,
    /// Pages that were loaded from the panel and know this word.
    Token(String),
}

/// Why a connection is refused. The text is a sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The address under which the panel was reached is none of this computer, so that another site may stand behind it.
    #[error("the panel is reached by its address, 127.0.0.1 or localhost: a name of another site may point here")]
    Host,
    /// The page was loaded from elsewhere.
    #[error("this page was not loaded from the panel: open the address that vergence prints")]
    Origin,
    /// The word is missing or wrong.
    #[error("the token is missing or wrong: open the address that vergence prints, with its token")]
    Token,
}

/// What a connection says of itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Claim<'a> {
    /// The header `Host`.
    pub host: Option<&'a str>,
    /// The header `Origin`, which browsers set and pages cannot.
    pub origin: Option<&'a str>,
    /// The token in the address.
    pub token: Option<&'a str>,
}

impl Access {
    /// Lets a reader in, who changes nothing.
    ///
    /// # Errors
    /// [`Refused`]
    pub fn check_reader(&self, claim: &Claim<'_>) -> Result<(), Refused> {
        match self {
            Self::Token(token) if claim.token.is_some_and(|given| is_same(given, token)) => Ok(()),
            Self::Token(_) => Err(Refused::Token),
            // A site can let its own name point to 127.0.0.1; its pages then count as loaded from here.
            Self::ThisComputer if claim.host.is_some_and(is_this_computer) => Ok(()),
            Self::ThisComputer => Err(Refused::Host),
        }
    }

    /// Lets a page in, which may drive: it must come from the panel.
    ///
    /// # Errors
    /// [`Refused`]
    pub fn check_page(&self, claim: &Claim<'_>) -> Result<(), Refused> {
        self.check_reader(claim)?;
        let origin = claim.origin.and_then(|origin| origin.strip_prefix("http://"));
        if origin.is_some() && origin == claim.host { Ok(()) } else { Err(Refused::Origin) }
    }
}

/// Whether `host`, with or without a port, is a fixed name of this computer.
fn is_this_computer(host: &str) -> bool {
    let name = host.rsplit_once(':').filter(|(_, port)| port.bytes().all(|byte| byte.is_ascii_digit()));
    matches!(name.map_or(host, |(name, _)| name), "127.0.0.1" | "localhost" | "[::1]")
}

/// Compares in a time that does not tell where they differ.
fn is_same(given: &str, token: &str) -> bool {
    let differences = given.bytes().zip(token.bytes()).fold(0, |all, (given, token)| all | (given ^ token));
    given.len() == token.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim<'a>(host: &'a str, origin: &'a str) -> Claim<'a> {
        Claim { host: Some(host), origin: Some(origin), token: None }
    }

    #[test]
    fn only_a_page_of_the_panel_itself_may_drive() {
        let access = Access::ThisComputer;
        for host in ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "localhost"] {
            assert_eq!(access.check_page(&claim(host, &format!("http://{host}"))), Ok(()), "{host}");
        }
        for origin in
            ["http://evil.example", "https://127.0.0.1:8000", "null", "http://127.0.0.1:8001", "http://127.0.0.1"]
        {
            assert_eq!(access.check_page(&claim("127.0.0.1:8000", origin)), Err(Refused::Origin), "{origin}");
        }
        let silent = Claim { origin: None, ..claim("127.0.0.1:8000", "") };
        assert_eq!(access.check_page(&silent), Err(Refused::Origin));
        assert_eq!(access.check_reader(&silent), Ok(()), "an address that is typed in has no origin");
    }

    #[test]
    fn a_name_that_another_site_lets_point_here_is_refused() {
        let host = "rebound.example:8000";
        assert_eq!(Access::ThisComputer.check_page(&claim(host, "http://rebound.example:8000")), Err(Refused::Host));
        assert_eq!(Access::ThisComputer.check_reader(&Claim::default()), Err(Refused::Host));
    }

    #[test]
    fn on_a_network_the_token_counts() {
        let access = Access::Token("secret".into());
        let right = Claim { token: Some("secret"), ..claim("bench.local:8000", "http://bench.local:8000") };
        assert_eq!(access.check_page(&right), Ok(()));
        assert_eq!(access.check_page(&Claim { origin: Some("http://evil.example"), ..right }), Err(Refused::Origin));
        for token in [None, Some(""), Some("secre"), Some("secret1"), Some("Secret")] {
            assert_eq!(access.check_page(&Claim { token, ..right }), Err(Refused::Token), "{token:?}");
        }
    }
}
