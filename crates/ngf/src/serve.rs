//! `ngf serve`: binds the server to the loopback address until it is told to stop.

use anyhow::Context;
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Downloads still running when the server is told to stop may take this long.
const GRACE: Duration = Duration::from_secs(3);

/// Where to listen and what to serve.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Port on 127.0.0.1; 0 takes any free one.
    #[arg(long, default_value_t = 8787)]
    port: u16,
    /// Folder of the built page.
    #[arg(long, value_name = "DIR", default_value = "web/dist")]
    web: PathBuf,
    /// Folder of the models, one folder each.
    #[arg(long, value_name = "DIR", default_value = "models")]
    models: PathBuf,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
}

/// Serves until Ctrl-C or SIGTERM.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    tokio::runtime::Runtime::new().context("no runtime")?.block_on(serve(options))
}

async fn serve(options: &Options) -> anyhow::Result<()> {
    let wanted = SocketAddr::from((Ipv4Addr::LOCALHOST, options.port));
    let listener = tokio::net::TcpListener::bind(wanted).await.with_context(|| {
        format!("cannot listen on {wanted}; if it is in use, choose another with --port")
    })?;
    let address = format!("http://{}", listener.local_addr()?);
    println!("{address}");
    std::io::stdout().flush()?;
    if options.open {
        open(&address);
    }

    let app = server::app(server::AppState::new(&options.web, &options.models));
    let (stopping, mut stopped) = tokio::sync::watch::channel(false);
    let serving = axum::serve(listener, app).with_graceful_shutdown(async move {
        stop_signal().await;
        stopping.send_replace(true);
    });
    let deadline = async {
        // An error here means that serving has ended already, and the other branch is taken.
        stopped.wait_for(|stopped| *stopped).await.ok();
        tokio::time::sleep(GRACE).await;
    };
    tokio::select! {
        result = serving => result.context("the server failed"),
        () = deadline => Ok(()),
    }
}

/// Resolves at Ctrl-C, and at SIGTERM where there is one.
async fn stop_signal() {
    let interrupt = tokio::signal::ctrl_c();
    #[cfg(unix)]
    if let Ok(mut terminate) =
        tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
    {
        tokio::select! {
            _ = interrupt => {}
            _ = terminate.recv() => {}
        }
        return;
    }
    interrupt.await.ok();
}

/// Opens the page, where there is a desktop to open it on; the address was printed in any case.
fn open(address: &str) {
    let has_desktop = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|v| std::env::var_os(v).is_some());
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(windows) {
        Command::new("explorer")
    } else if has_desktop {
        Command::new("xdg-open")
    } else {
        return;
    };
    let silent = command.arg(address).stdin(Stdio::null()).stdout(Stdio::null());
    // A desktop without a browser is no reason not to serve.
    silent.stderr(Stdio::null()).spawn().ok();
}
