//! Requests that are let in: those that name this server and know its token.
//!
//! Every process of this machine reaches the loopback, and so does every page that a browser shows. The token keeps out
//! other users; the check of the header `Host` keeps out pages whose name was made to lead here (DNS rebinding).

use subtle::ConstantTimeEq as _;

/// Bytes of a token: no one guesses 128 bits.
const TOKEN_BYTES: usize = 16;
/// Begins the part of the path that holds the token.
const PREFIX: &str = "token=";

/// Reason why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The header `Host` names another server.
    Host,
    /// The token is missing or wrong.
    Token,
}

impl Refusal {
    /// The text of the answer.
    pub fn text(self) -> &'static str {
        match self {
            Self::Host => {
                "hummingbus view: the request names another server; open the address that the command printed.\n"
            }
            Self::Token => {
                "hummingbus view: the token is missing or wrong; open the whole address that the command printed.\n"
            }
        }
    }
}

/// Token and port that a request must name.
#[derive(Debug)]
pub struct Gate {
    token: String,
    port: u16,
}

impl Gate {
    /// A gate of the server at this port, with a new token.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub fn new(port: u16) -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self { token: bytes.iter().map(|byte| format!("{byte:02x}")).collect(), port })
    }

    /// The address of the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{PREFIX}{}/", self.port, self.token)
    }

    /// Lets in a request for `path` with this header `Host`, or refuses it.
    ///
    /// # Errors
    /// The reason.
    pub fn check(&self, host: Option<&str>, path: &str) -> Result<(), Refusal> {
        let names = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port));
        if !host.is_some_and(|host| names.iter().any(|name| name == host)) {
            return Err(Refusal::Host);
        }
        let first = path.trim_start_matches('/').split('/').next().unwrap_or_default();
        let token = first.strip_prefix(PREFIX).ok_or(Refusal::Token)?;
        // A comparison that ends at the first difference would show a guesser the number of right characters.
        if bool::from(token.as_bytes().ct_eq(self.token.as_bytes())) { Ok(()) } else { Err(Refusal::Token) }
    }
}

#[cfg(test)]
mod tests {
    use super::{Gate, Refusal};

    #[test]
    fn only_the_token_behind_this_server_s_name_opens() {
        let gate = Gate { token: "0123abcd".to_owned(), port: 4000 };
        let path = "/token=0123abcd/api/frames";
        for host in ["127.0.0.1:4000", "localhost:4000"] {
            assert_eq!(gate.check(Some(host), path), Ok(()));
        }
        for host in [None, Some("127.0.0.1"), Some("evil.example:4000"), Some("127.0.0.1:4001")] {
            assert_eq!(gate.check(host, path), Err(Refusal::Host), "{host:?}");
        }
        for path in
            ["/", "/token=/", "/token=0123abce/", "/token=0123abc/", "/0123abcd/", "/x/token=0123abcd/"]
        {
            assert_eq!(gate.check(Some("127.0.0.1:4000"), path), Err(Refusal::Token), "{path}");
        }
    }

    #[test]
    fn tokens_differ() {
        let [a, b] = [Gate::new(1).unwrap(), Gate::new(1).unwrap()];
        assert_ne!(a.token, b.token);
        assert_eq!(a.token.len(), 32);
        assert_eq!(a.address(), format!("http://127.0.0.1:1/token={}/", a.token));
    }
}
