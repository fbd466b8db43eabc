//! Credentials of a request: bearer token, password of a browser, session cookie.

use axum::http::{HeaderMap, header};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Name of the session cookie.
pub(super) const COOKIE: &str = "ngf_session";

/// Credentials of a request.
#[derive(Debug, Default)]
pub(crate) struct Credentials {
    token: Option<String>,
    cookie: Option<String>,
}

impl Credentials {
    /// Credentials in these headers. The token is a bearer token, or the password of basic authentication.
    pub(crate) fn of(headers: &HeaderMap) -> Self {
        let token = scheme_value(headers, "Bearer").map(str::to_owned);
        let cookies =
            headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| {
            let (name, value) = pair.trim().split_once('=')?;
            (name == COOKIE).then(|| value.to_owned())
        });
        Self { token: token.or_else(|| password(headers)), cookie: pairs.next() }
    }

    /// The token.
    pub(super) fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Value of the session cookie.
    pub(super) fn cookie(&self) -> Option<&str> {
        self.cookie.as_deref()
    }
}

/// Bearer token of a request; empty if there is none.
pub(crate) fn bearer_token(headers: &HeaderMap) -> &str {
    scheme_value(headers, "Bearer").unwrap_or_default()
}

/// Credentials of this authentication scheme. Names of schemes have no case (RFC 9110, 11.1).
fn scheme_value<'a>(headers: &'a HeaderMap, scheme: &str) -> Option<&'a str> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (name, value) = value.split_once(' ')?;
    name.eq_ignore_ascii_case(scheme).then(|| value.trim_start_matches(' '))
}

/// Password of basic authentication (RFC 7617).
fn password(headers: &HeaderMap) -> Option<String> {
    let pair = STANDARD.decode(scheme_value(headers, "Basic")?).ok()?;
    let pair = String::from_utf8(pair).ok()?;
    Some(pair.split_once(':')?.1.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn token(authorization: &'static str) -> Option<String> {
        let value = authorization.parse().unwrap();
        Credentials::of(&[(header::AUTHORIZATION, value)].into_iter().collect()).token
    }

    #[test]
    fn token_is_read_from_any_spelling_of_the_scheme() {
        for text in ["Bearer T", "bearer T", "BEARER  T", "Basic bmdmOlQ=", "basic OlQ="] {
            assert_eq!(token(text).as_deref(), Some("T"), "{text}");
        }
        for text in ["T", "BearerT", "Digest T", "Basic !", "Basic VA=="] {
            assert_eq!(token(text), None, "{text}");
        }
    }

    #[test]
    fn session_cookie_is_found_among_others() {
        let headers: HeaderMap =
            [(header::COOKIE, "a=b; ngf_session=c; d=e".parse().unwrap())].into_iter().collect();
        assert_eq!(Credentials::of(&headers).cookie(), Some("c"));
    }
}
