//! Access control of a web server: it checks host, origin and token of requests, and adds the
//! security headers to responses. In: requests. Out: responses. Thread: the server's.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};

use super::http::ClientAddress;
use super::origin;
use super::setup_access::{self, SetupAccess};
use super::token::Token;

/// Text of the response to a request without a valid token.
const NO_TOKEN: &str =
    "Open this show's page by the link or the QR code that Corybant prints at its start.";

/// Security headers of every response: the page may run only its own files and connect only to this
/// server.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
    (header::CACHE_CONTROL, "no-cache"),
    (header::SERVER, SERVER),
];
/// Name of the program in every response. A second start recognises the first one by it.
pub(super) const SERVER: &str = "Corybant";

/// The access rules of a server: its network address, and the tokens that requests must contain.
pub(crate) struct Access {
    /// Network address on which the server listens.
    pub(super) listen: SocketAddr,
    /// Token that requests must contain; `None` if no token is needed.
    pub(super) token: Option<Token>,
    /// Access to the requests below `/setup/`; `None` if the server has no such requests.
    pub(super) setup: Option<Arc<SetupAccess>>,
}

impl Access {
    /// Returns `router` with access control: a request reaches the router only if it passes
    /// [`origin::check`] and contains the token.
    pub(crate) fn protect(self, router: Router) -> Router {
        router.layer(middleware::from_fn_with_state(Arc::new(self), guard))
    }

    /// Passes a request with a valid token on to `next` and refuses a request without one. If the
    /// token is in the link, the browser gets the token as a cookie and is redirected to `/`, so
    /// that the address bar does not show the token.
    async fn check_token(&self, request: Request, next: Next) -> Response {
        match &self.token {
            Some(token) if token.is_in_link(request.uri()) && request.uri().path() == "/" => {
                keep_cookie(token.cookie())
            }
            Some(token)
                if !token.is_in_link(request.uri()) && !token.is_in_headers(request.headers()) =>
            {
                (StatusCode::UNAUTHORIZED, NO_TOKEN).into_response()
            }
            _ => next.run(request).await,
        }
    }
}

impl Access {
    /// Returns the response to a request that needs the access to the setup and does not have it,
    /// or that brings this access to a browser. `None` for all other requests.
    fn check_setup(&self, request: &Request) -> Option<Response> {
        let setup = self.setup.as_ref()?;
        let (path, port) = (request.uri().path(), self.listen.port());
        if path == "/" {
            return setup.cookie_for(request.uri(), port).map(keep_cookie);
        }
        if !path.starts_with(setup_access::PREFIX) {
            return None;
        }
        let client = request.extensions().get::<ClientAddress>();
        let checked = setup.check(client.map(|client| client.0), request.headers(), port);
        checked.err().map(|why| {
            let json = serde_json::json!({ "message": why }).to_string();
            let media = [(header::CONTENT_TYPE, "application/json")];
            (StatusCode::FORBIDDEN, media, json).into_response()
        })
    }
}

/// Returns a response with which the browser keeps a cookie and opens the page without the token in
/// the address bar. `cookie` is the value of the header `Set-Cookie`.
fn keep_cookie(cookie: String) -> Response {
    let headers = [(header::SET_COOKIE, cookie), (header::LOCATION, "/".into())];
    (StatusCode::SEE_OTHER, headers).into_response()
}

async fn guard(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let mut response = match origin::check(access.listen.ip(), request.headers()) {
        Ok(()) => match access.check_setup(&request) {
            Some(response) => response,
            None => access.check_token(request, next).await,
        },
        Err(error) => (StatusCode::FORBIDDEN, error.to_string()).into_response(),
    };
    for (name, value) in HEADERS {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    response
}
