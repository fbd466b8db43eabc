//! Access to the server: token, host names and trusted proxies.

use super::credentials::Credentials;
use axum::http::{HeaderMap, Method, header};
use std::net::{IpAddr, SocketAddr};

/// Context of the key derivation for session cookies.
const COOKIE_CONTEXT: &str = "ngf-grasp 2026-11 session cookie";

/// Who may access the server, under which host names.
#[derive(Clone, Debug, Default)]
pub(crate) struct Access {
    token: Option<Token>,
    /// Whether read requests also need the token.
    reads_need_token: bool,
    /// Host names of the server, in addition to its addresses.
    host_names: Vec<String>,
    /// Addresses of proxies whose `X-Forwarded-*` headers are used.
    trusted_proxies: Vec<IpAddr>,
}

/// Token of the server.
#[derive(Clone, Debug)]
struct Token {
    /// BLAKE3 of the token.
    hash: blake3::Hash,
    /// Value of the cookie that permits read requests. The token does not follow from it.
    cookie: String,
}

/// How a request is rejected that lacks the token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Challenge {
    /// For programs, and for scripts of the page, which asks for the token itself.
    Bearer,
    /// For pages: the browser asks for a password, which is the token.
    Basic,
}

impl Access {
    /// Requires this token for write requests.
    pub(crate) fn set_token(&mut self, token: &str) {
        let cookie = blake3::derive_key(COOKIE_CONTEXT, token.as_bytes());
        let cookie = blake3::Hash::from_bytes(cookie).to_hex().to_string();
        self.token = Some(Token { hash: blake3::hash(token.as_bytes()), cookie });
    }

    /// Requires the token for read requests, too.
    pub(crate) fn set_reads_need_token(&mut self) {
        self.reads_need_token = true;
    }

    /// Sets the host names of the server.
    pub(crate) fn set_host_names(&mut self, names: Vec<String>) {
        self.host_names = names;
    }

    /// Sets the proxies whose `X-Forwarded-*` headers are used.
    pub(crate) fn set_trusted_proxies(&mut self, addresses: Vec<IpAddr>) {
        self.trusted_proxies = addresses;
    }

    /// Whether read requests need the token.
    pub(crate) fn reads_need_token(&self) -> bool {
        self.reads_need_token && self.token.is_some()
    }

    /// Whether this token authorizes write requests. Hashes are compared in constant time.
    pub(crate) fn token_matches(&self, token: &str) -> bool {
        self.token.as_ref().is_none_or(|known| known.hash == blake3::hash(token.as_bytes()))
    }

    /// The challenge with which a read request is rejected; `None` if it is permitted. The files of the page are
    /// public: only its HTML needs the token, so that the browser asks for it.
    pub(crate) fn read_challenge(
        &self,
        method: &Method,
        path: &str,
        credentials: &Credentials,
    ) -> Option<Challenge> {
        let token = self.token.as_ref().filter(|_| self.reads_need_token)?;
        let is_api = path == "/metrics" || path == "/api" || path.starts_with("/api/");
        let is_page = path.ends_with('/') || path.ends_with(".html");
        let challenge = match () {
            // CORS preflights have no credentials.
            () if *method == Method::OPTIONS => return None,
            () if is_api => Challenge::Bearer,
            () if is_page => Challenge::Basic,
            () => return None,
        };
        let is_authorized = credentials.token().is_some_and(|token| self.token_matches(token))
            || credentials.cookie().is_some_and(|cookie| is_equal(cookie, &token.cookie));
        (!is_authorized).then_some(challenge)
    }

    /// Cookie for the browser that has sent the token, which event streams and downloads of the page need; `None`
    /// if reading needs no token or the browser has the cookie.
    pub(crate) fn new_cookie(&self, credentials: &Credentials, is_https: bool) -> Option<String> {
        let token = self.token.as_ref().filter(|_| self.reads_need_token)?;
        let is_known = credentials.cookie().is_some_and(|cookie| is_equal(cookie, &token.cookie));
        let is_authorized = credentials.token().is_some_and(|token| self.token_matches(token));
        let secure = if is_https { "; Secure" } else { "" };
        let attributes = format!("Path=/; HttpOnly; SameSite=Strict{secure}");
        (is_authorized && !is_known)
            .then(|| format!("{}={}; {attributes}", super::credentials::COOKIE, token.cookie))
    }

    /// Whether requests may address the server by this `Host` header. DNS rebinding maps a foreign name to the
    /// address of the server, but cannot change the name in the header.
    pub(crate) fn is_own_host(&self, host: &str) -> bool {
        let name = host_name(host);
        if is_loopback(name) || self.host_names.iter().any(|own| own.eq_ignore_ascii_case(name)) {
            return true;
        }
        // Without a token, the server listens on a loopback address only.
        self.token.is_some() && (self.host_names.is_empty() || name.parse::<IpAddr>().is_ok())
    }

    /// Address of the client: of the peer, or, behind a trusted proxy, the last foreign one in `X-Forwarded-For`.
    pub(crate) fn client_address(&self, peer: IpAddr, headers: &HeaderMap) -> IpAddr {
        let is_trusted = |address: &IpAddr| self.trusted_proxies.contains(&address.to_canonical());
        if !is_trusted(&peer) {
            return peer;
        }
        let values = headers.get_all("x-forwarded-for").iter().rev();
        let values = values.filter_map(|value| value.to_str().ok());
        let addresses = values.flat_map(|value| value.rsplit(','));
        // An invalid entry ends the chain: the entries before it may be forged.
        let mut addresses = addresses.map_while(|text| forwarded_address(text.trim()));
        addresses.find(|address| !is_trusted(address)).unwrap_or(peer)
    }

    /// Whether the client uses HTTPS, as stated by a trusted proxy.
    pub(crate) fn is_https(&self, peer: Option<IpAddr>, headers: &HeaderMap) -> bool {
        let is_trusted =
            peer.is_some_and(|peer| self.trusted_proxies.contains(&peer.to_canonical()));
        is_trusted && headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https")
    }

    /// Origin of a browser request that is not the server's own. Browsers send requests of any page to a server
    /// on the loopback address.
    pub(crate) fn foreign_origin(headers: &HeaderMap) -> Option<&str> {
        let origin = headers.get(header::ORIGIN)?.to_str().unwrap_or_default();
        let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
        let own = origin.split_once("://").map(|(_, rest)| rest);
        let is_own = own.is_some_and(|own| own.eq_ignore_ascii_case(host.unwrap_or_default()));
        (!is_own).then_some(origin)
    }
}

/// Compares two texts in constant time.
fn is_equal(one: &str, other: &str) -> bool {
    blake3::hash(one.as_bytes()) == blake3::hash(other.as_bytes())
}

/// Host name or address in a `Host` header, without port, brackets and final dot.
fn host_name(host: &str) -> &str {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name.strip_suffix('.').unwrap_or(name)
}

/// Address in an entry of `X-Forwarded-For`: some proxies add a port, or brackets to IPv6.
fn forwarded_address(text: &str) -> Option<IpAddr> {
    let without_brackets = || text.strip_prefix('[')?.strip_suffix(']')?.parse().ok();
    let address = text.parse().ok().or_else(without_brackets);
    address.or_else(|| Some(text.parse::<SocketAddr>().ok()?.ip()))
}

/// Whether a host name refers to this machine.
fn is_loopback(name: &str) -> bool {
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn headers(name: &'static str, values: &[&'static str]) -> HeaderMap {
        values
            .iter()
            .map(|value| (name.parse().unwrap(), HeaderValue::from_static(value)))
            .collect()
    }

    #[test]
    fn only_loopback_hosts_are_own_without_a_token() {
        let access = Access::default();
        for host in
            ["localhost", "LOCALHOST:8787", "localhost.", "127.0.0.1:1", "127.1.2.3", "[::1]:8787"]
        {
            assert!(access.is_own_host(host), "{host}");
        }
        for host in ["", "evil.example:8787", "localhost.evil.example", "10.0.0.1", "[::2]:1"] {
            assert!(!access.is_own_host(host), "{host}");
        }
    }

    #[test]
    fn host_names_limit_a_server_with_a_token() {
        let mut access = Access::default();
        access.set_token("0123456789abcdef");
        assert!(access.is_own_host("evil.example"));
        access.set_host_names(vec!["lab.example".into()]);
        for host in ["Lab.Example:443", "10.0.0.1:8787", "[2001:db8::1]", "localhost"] {
            assert!(access.is_own_host(host), "{host}");
        }
        assert!(!access.is_own_host("evil.example"));
    }

    #[test]
    fn forwarded_address_is_used_only_behind_a_trusted_proxy() {
        let mut access = Access::default();
        let [proxy, inner, client]: [IpAddr; 3] =
            ["10.0.0.1", "10.0.0.2", "198.51.100.7"].map(|text| text.parse().unwrap());
        let forwarded = headers("x-forwarded-for", &["203.0.113.9, 198.51.100.7", "10.0.0.2"]);
        assert_eq!(access.client_address(proxy, &forwarded), proxy);
        access.set_trusted_proxies(vec![proxy, inner]);
        assert_eq!(access.client_address(proxy, &forwarded), client);
        assert_eq!(access.client_address(client, &forwarded), client);
        // The client itself has sent the entries before an invalid one.
        let forged = headers("x-forwarded-for", &["203.0.113.9, unknown"]);
        assert_eq!(access.client_address(proxy, &forged), proxy);
        assert_eq!(access.client_address(proxy, &HeaderMap::new()), proxy);
        for (entry, address) in [
            ("198.51.100.7:4711", "198.51.100.7"),
            ("[2001:db8::1]:4711", "2001:db8::1"),
            ("[2001:db8::1]", "2001:db8::1"),
            ("2001:db8::1", "2001:db8::1"),
        ] {
            let address: IpAddr = address.parse().unwrap();
            let forwarded = headers("x-forwarded-for", &[entry]);
            assert_eq!(access.client_address(proxy, &forwarded), address, "{entry}");
        }
        let https = headers("x-forwarded-proto", &["https"]);
        assert!(access.is_https(Some(proxy), &https) && !access.is_https(Some(client), &https));
    }

    #[test]
    fn cookie_permits_reading_and_does_not_reveal_the_token() {
        let token = "0123456789abcdef";
        let mut access = Access::default();
        access.set_token(token);
        access.set_reads_need_token();
        let challenge = |headers: &HeaderMap| {
            access.read_challenge(&Method::GET, "/api/v1/jobs", &Credentials::of(headers))
        };
        assert_eq!(challenge(&HeaderMap::new()), Some(Challenge::Bearer));
        let bearer = headers("authorization", &["bearer 0123456789abcdef"]);
        assert_eq!(challenge(&bearer), None);
        let cookie = access.new_cookie(&Credentials::of(&bearer), true).unwrap();
        assert!(cookie.ends_with("HttpOnly; SameSite=Strict; Secure"), "{cookie}");
        assert!(!cookie.contains(token));
        let value = cookie.split(';').next().unwrap();
        let sent: HeaderMap = [(header::COOKIE, value.parse().unwrap())].into_iter().collect();
        assert_eq!(challenge(&sent), None);
        assert_eq!(access.new_cookie(&Credentials::of(&sent), true), None);
        let wrong = headers("cookie", &["ngf_session=0000"]);
        assert_eq!(challenge(&wrong), Some(Challenge::Bearer));
    }
}
