//! The import page (`corybant import`): motion files to labelled clips and a motion graph. In: the
//! user's files and settings. Out: a folder of motion files with its `clips.toml`, a graph file.
//! Thread: "import-page" with a single-threaded tokio runtime for the page; "import" reads motions
//! and builds the graph, on one core while a show runs in this program.
//!
//! ```text
//! page ─▶ routes ─▶ folder ─▶ motion files, clips.toml (clips_text)
//!                     └─▶ work ─▶ report on each file, graph file, dance ─▶ page
//! ```

mod clips_text;
mod folder;
mod report;
mod routes;
mod work;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Value, json};

use crate::web::bound_server::BoundServer;
use crate::web::http::server_thread::ServerThread;
use crate::web::{DEFAULT_LISTEN, PageError, Settings, SetupAccess};
use corybant_files::shown;
use folder::Folder;
use report::Report;

/// Interval at which the main thread checks whether the page must end.
const STOP_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Network address of the page if another program uses the usual one.
const FREE_LISTEN: &str = "127.0.0.1:0";

/// Progress of the last build of the graph.
#[derive(Default)]
enum Progress {
    /// There was no build.
    #[default]
    None,
    /// A build runs; `share` of its work is done, 0 to 1.
    Running { share: f32 },
    /// The last build has succeeded; `text` says what the graph contains.
    Done { text: String },
    /// The last build has failed; `text` says why.
    Failed { text: String },
}

/// The motion files of the page, and the work on them.
pub struct Importer {
    folder: Mutex<Folder>,
    state: Mutex<State>,
    /// True if the user has ended the page.
    end: AtomicBool,
    /// True if a show runs in this program, which needs the other processor cores.
    is_beside_show: bool,
}

/// The part of an [`Importer`] that the thread "import" changes.
#[derive(Default)]
struct State {
    is_working: bool,
    must_read: bool,
    must_build: bool,
    /// Share of the motions that are read, 0 to 1; `None` if none are being read.
    reading: Option<f32>,
    report: Arc<Report>,
    /// Number of the report; it grows with each report.
    generation: u64,
    build: Progress,
    /// True if files or settings have changed since the last build.
    is_stale: bool,
    /// Packed dance of the last graph; `None` before the first build.
    dance: Option<Arc<[u8]>>,
}

impl Importer {
    /// Creates an importer for the user's folder `path`; without a path, for a private folder. Starts
    /// to read the motions.
    ///
    /// # Errors
    /// A sentence if the folder cannot be read, or a private folder or a thread cannot be made.
    pub fn new(path: Option<&Path>) -> Result<Arc<Self>, String> {
        let folder = path.map_or_else(Folder::private, |path| Ok(Folder::of_user(path)))?;
        Self::of(folder, false)
    }

    /// Creates an importer for the folder `path` while a show runs in this program. It works on one
    /// processor core.
    ///
    /// # Errors
    /// Those of [`Importer::new`].
    pub fn beside_show(path: &Path) -> Result<Arc<Self>, String> {
        Self::of(Folder::of_user(path), true)
    }

    fn of(folder: Folder, is_beside_show: bool) -> Result<Arc<Self>, String> {
        folder.listing()?;
        let importer = Arc::new(Self {
            folder: Mutex::new(folder),
            state: Mutex::default(),
            end: AtomicBool::new(false),
            is_beside_show,
        });
        importer.start_reading()?;
        Ok(importer)
    }

    /// Adds a copy of the motion file or ZIP `name` with the contents `bytes`. Its label comes from
    /// its name. Returns a sentence for each file of a ZIP that is not added.
    ///
    /// # Errors
    /// A sentence that says why nothing is added.
    pub fn add(self: &Arc<Self>, name: &str, bytes: &[u8]) -> Result<Vec<String>, String> {
        let label = crate::offline::motion_dir::uploads::label_from(name);
        self.add_with_label(&label, name, bytes)
    }

    fn add_with_label(
        self: &Arc<Self>,
        label: &str,
        name: &str,
        bytes: &[u8],
    ) -> Result<Vec<String>, String> {
        let added = self.folder().add(label, name, bytes);
        // A ZIP may be added in part.
        self.state().is_stale = true;
        self.start_reading()?;
        added
    }

    /// Removes an empty private folder at the end of the program. Returns the path of a private folder
    /// with files that the user has not saved, which is kept.
    pub fn finish(&self) -> Option<PathBuf> {
        self.folder().keep()
    }

    fn folder(&self) -> MutexGuard<'_, Folder> {
        self.folder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns everything that the page shows, but thumbnails and the dance.
    fn to_json(&self) -> Value {
        let folder = self.folder();
        let (path, graph, is_private) = (folder.path(), folder.graph(), folder.is_private());
        let (shown_path, shown_graph) = (shown(path), shown(&graph));
        let (listing, problem) = match folder.listing() {
            Ok(listing) => (Some(listing), None),
            Err(why) => (None, Some(why)),
        };
        let entries = listing.iter().flat_map(|listing| &listing.entries);
        let removable: Vec<bool> = entries
            .map(|entry| folder.may_remove(&entry.file))
            .collect();
        drop(folder);
        let state = self.state();
        let (progress, text, share) = match &state.build {
            Progress::None => ("none", "", 0.0),
            Progress::Running { share } => ("running", "", *share),
            Progress::Done { text } => ("done", text.as_str(), 1.0),
            Progress::Failed { text } => ("failed", text.as_str(), 1.0),
        };
        let entries = listing.iter().flat_map(|listing| &listing.entries);
        let entries = entries.zip(removable);
        let files: Vec<Value> = entries
            .map(|(entry, removable)| {
                let mut file = state.report.of(&entry.file);
                file["file"] = json!(entry.file);
                file["label"] = json!(entry.label().unwrap_or_default());
                file["start_s"] = json!(entry.start_s);
                file["end_s"] = json!(entry.end_s);
                file["idle"] = json!(entry.idle);
                file["on_request"] = json!(entry.on_request);
                file["mirror"] = json!(entry.mirror);
                file["removable"] = json!(removable);
                file
            })
            .collect();
        json!({
            "folder": shown_path,
            "private": is_private,
            "saved_to": corybant_files::shown(&crate::daemon::setup::default_folder()),
            "graph": shown_graph,
            "mirror": listing.as_ref().is_none_or(|listing| listing.mirror),
            "problem": problem.as_ref().or(state.report.problem.as_ref()),
            "warnings": state.report.warnings,
            "files": files,
            "busy": state.is_working,
            "reading": state.reading,
            "generation": state.generation,
            "build": {
                "state": progress, "text": text, "share": share, "stale": state.is_stale,
                "dance": state.dance.is_some(),
            },
        })
    }
}

/// The running server of the import page; dropping it stops the server.
pub struct ImportServer {
    local_addr: SocketAddr,
    access: Arc<SetupAccess>,
    importer: Arc<Importer>,
    _thread: ServerThread,
}

impl ImportServer {
    /// Returns the network address of the server; the port is never 0.
    pub fn local_addr(&self) -> SocketAddr {
        self.local_addr
    }

    /// Returns the link to the page, which works in every browser of this machine.
    pub fn link(&self) -> String {
        self.access.link(self.local_addr)
    }

    /// Returns a link to the page that works in one browser, once.
    ///
    /// # Errors
    /// [`PageError::Random`] if the system gives no random numbers.
    pub fn link_for_once(&self) -> Result<String, PageError> {
        self.access.link_for_once(self.local_addr)
    }

    /// Returns true if the user has ended the page.
    pub fn has_ended(&self) -> bool {
        self.importer.end.load(Ordering::Relaxed)
    }

    /// Serves the page until `stop` is true or the user ends the page.
    pub fn serve_until(&self, stop: &AtomicBool) {
        while !(stop.load(Ordering::Relaxed) || self.has_ended()) {
            std::thread::sleep(STOP_CHECK_INTERVAL);
        }
    }
}

/// Serves the page for `importer` until the returned [`ImportServer`] is dropped. `listen` is a
/// network address of this machine; without it, the page is at the usual address, or at any free port
/// if that one is in use.
///
/// # Errors
/// [`PageError`] if the system refuses the address, a thread or random numbers.
pub fn serve(listen: Option<&str>, importer: &Arc<Importer>) -> Result<ImportServer, PageError> {
    match serve_at(listen.unwrap_or(DEFAULT_LISTEN), importer) {
        Err(PageError::InUse { .. }) if listen.is_none() => serve_at(FREE_LISTEN, importer),
        served => served,
    }
}

/// Returns `text` if it is a network address of this computer alone.
///
/// # Errors
/// A part of a sentence with the allowed addresses.
pub fn checked_address(text: &str) -> Result<String, String> {
    let address: Option<SocketAddr> = text.parse().ok();
    match address.filter(|address| address.ip().is_loopback()) {
        Some(_) => Ok(text.into()),
        None => Err(format!(
            "must be an address of this computer alone with a port, such as {DEFAULT_LISTEN}"
        )),
    }
}

fn serve_at(listen: &str, importer: &Arc<Importer>) -> Result<ImportServer, PageError> {
    let BoundServer {
        runtime,
        listener,
        local_addr,
        access,
        ..
    } = BoundServer::bind(&Settings {
        listen: listen.into(),
        ..Settings::default()
    })?;
    let setup = Arc::new(SetupAccess::new()?);
    let access = access.with_setup(setup.clone());
    let served = importer.clone();
    let thread = ServerThread::start("import-page", runtime, |stopped| {
        routes::run(listener, access, served, stopped)
    })
    .map_err(|source| PageError::Thread { source })?;
    Ok(ImportServer {
        local_addr,
        access: setup,
        importer: importer.clone(),
        _thread: thread,
    })
}
