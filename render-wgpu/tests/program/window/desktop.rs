//! A display without a screen, and a person's hands and eyes on it: events as from real devices, and
//! screenshots.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::screenshot::Screenshot;
use crate::command::{command, read_json};
use serde_json::Value;
use tempfile::TempDir;
use x11rb::CURRENT_TIME;
use x11rb::connection::Connection;
use x11rb::cookie::VoidCookie;
use x11rb::errors::ConnectionError;
use x11rb::protocol::xproto::{
    Atom, AtomEnum, BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ClientMessageEvent,
    ConfigureWindowAux, ConnectionExt, EventMask, ImageFormat, InputFocus, KEY_PRESS_EVENT,
    KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT, MapState, PropMode, Window,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

/// The display's width and height, in pixels.
const SCREEN: (u16, u16) = (1280, 1024);
/// How long anything is waited for: a software adapter on a busy machine is slow.
const PATIENCE: Duration = Duration::from_secs(300);
/// How long one waits before looking again.
const GLANCE: Duration = Duration::from_millis(100);
/// For how long a picture that stands still has not changed.
pub(crate) const STILL: Duration = Duration::from_millis(1_500);

/// Looks until `look` finds something.
fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited in vain for {what}");
        sleep(GLANCE);
    }
}

/// An X server without a screen, which ends with its last client.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let start = Instant::now();
        while let Ok(None) = self.0.try_wait() {
            if start.elapsed() > PATIENCE {
                let _ = self.0.kill();
            }
            sleep(GLANCE);
        }
    }
}

/// A display on which nothing manages windows.
pub(crate) struct Desktop {
    connection: RustConnection,
    root: Window,
    number: String,
    runtime: TempDir,
    // Dropped after the connection.
    _server: Server,
}

impl Desktop {
    pub(crate) fn start() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-screen", "0", &format!("{}x{}x24", SCREEN.0, SCREEN.1)])
            .args(["-displayfd", "1", "-nolisten", "tcp", "-terminate"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts, of the package xvfb");
        let mut number = String::new();
        let mut told = BufReader::new(server.stdout.take().expect("it is piped"));
        told.read_line(&mut number).expect("Xvfb says its display's number");
        let number = format!(":{}", number.trim());
        let (connection, screen) =
            RustConnection::connect(Some(&number)).expect("Xvfb takes connections");
        let root = connection.setup().roots[screen].root;
        let runtime = tempfile::tempdir().expect("a folder that only this user can look into");
        Self { connection, root, number, runtime, _server: Server(server) }
    }

    /// The program with arguments, on this display.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = command(args);
        command
            .env("DISPLAY", &self.number)
            .env("XDG_RUNTIME_DIR", self.runtime.path())
            .env("WINIT_X11_SCALE_FACTOR", "1");
        command
    }

    /// Runs the program, which says that it has no window if that is so, to its end, and gives back what it reported.
    pub(crate) fn watch(&self, args: &[&str]) -> Value {
        // Who looks for a picture may come too late.
        self.launch(args).end()
    }

    /// Runs the program until there is something to be seen in its window.
    pub(crate) fn open(&self, args: &[&str]) -> Session<'_> {
        let mut session = self.launch(args);
        session.window = wait_for("the window", || {
            session.check();
            self.window_called("dualframe")
        });
        session.wait_for("a picture", Screenshot::is_drawn);
        self.focus(session.window);
        session
    }

    fn launch(&self, args: &[&str]) -> Session<'_> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = |name| File::create(folder.path().join(name)).expect("a file");
        let report = folder.path().join("report.json");
        let mut command = self.command(args);
        command.arg("--json").arg(&report).stdout(file("stdout")).stderr(file("stderr"));
        let child = command.spawn().expect("the program starts");
        Session { desktop: self, child, folder, window: x11rb::NONE }
    }

    /// Gives a window the keyboard.
    fn focus(&self, window: Window) {
        let asked = self.connection.set_input_focus(InputFocus::PARENT, window, CURRENT_TIME);
        self.sync(asked);
    }

    /// Presses the key of a symbol, or lets it go.
    fn key(&self, symbol: char, is_down: bool) {
        let kind = if is_down { KEY_PRESS_EVENT } else { KEY_RELEASE_EVENT };
        self.fake(kind, self.keycode(symbol.into()), 0, 0);
    }

    fn window_called(&self, title: &str) -> Option<Window> {
        let tree = self.connection.query_tree(self.root).ok()?.reply().ok()?;
        tree.children.into_iter().find(|&window| self.is_called(window, title) == Some(true))
    }

    fn is_called(&self, window: Window, title: &str) -> Option<bool> {
        let (name, text) = (AtomEnum::WM_NAME, AtomEnum::ANY);
        let name = self.connection.get_property(false, window, name, text, 0, 64).ok()?;
        let attributes = self.connection.get_window_attributes(window).ok()?;
        let is_mapped = attributes.reply().ok()?.map_state == MapState::VIEWABLE;
        Some(name.reply().ok()?.value == title.as_bytes() && is_mapped)
    }

    fn fake(&self, kind: u8, detail: u8, x: i16, y: i16) {
        let (now, root) = (CURRENT_TIME, self.root);
        self.sync(self.connection.xtest_fake_input(kind, detail, now, root, x, y, 0));
    }

    fn atom(&self, name: &str) -> Atom {
        let asked = self.connection.intern_atom(false, name.as_bytes());
        asked.expect("the server lives").reply().expect("an atom").atom
    }

    /// Waits until the server has done what it was asked for.
    fn sync(&self, asked: Result<VoidCookie<'_, RustConnection>, ConnectionError>) {
        asked.expect("the server lives").check().expect("the server does as it is asked");
    }

    fn keycode(&self, symbol: u32) -> u8 {
        let setup = self.connection.setup();
        let count = setup.max_keycode - setup.min_keycode + 1;
        let asked = self.connection.get_keyboard_mapping(setup.min_keycode, count);
        let mapping = asked.expect("the server lives").reply().expect("there is a keyboard");
        let mut keys = mapping.keysyms.chunks(usize::from(mapping.keysyms_per_keycode));
        let index = keys.position(|symbols| symbols.first() == Some(&symbol));
        setup.min_keycode + index.expect("the keyboard has the key") as u8
    }
}

/// The program while it shows a window.
pub(crate) struct Session<'a> {
    desktop: &'a Desktop,
    child: Child,
    folder: TempDir,
    window: Window,
}

impl Session<'_> {
    /// Looks until something is to be seen.
    pub(crate) fn wait_for(
        &mut self,
        what: &str,
        is_there: impl Fn(&Screenshot) -> bool,
    ) -> Screenshot {
        wait_for(what, || {
            self.check();
            self.screenshot().filter(&is_there)
        })
    }

    fn check(&mut self) {
        let ended = self.child.try_wait().expect("it can be waited for");
        assert!(ended.is_none(), "it ended: {ended:?} {}", self.read("stderr"));
    }

    /// Looks until something has been seen for a while.
    pub(crate) fn wait_until_lasting(
        &mut self,
        what: &str,
        is_there: impl Fn(&Screenshot) -> bool,
    ) {
        let mut since = Instant::now();
        wait_for(what, || {
            self.check();
            if !self.screenshot().is_some_and(|now| is_there(&now)) {
                since = Instant::now();
            }
            (since.elapsed() > 2 * STILL).then_some(())
        });
    }

    /// Looks until the picture stands still.
    pub(crate) fn wait_until_still(&mut self) -> Screenshot {
        let (mut last, mut since) = (None, Instant::now());
        wait_for("a picture that stands still", || {
            self.check();
            let now = self.screenshot();
            if now.is_none() || now != last {
                (last, since) = (now, Instant::now());
            }
            if since.elapsed() > STILL { last.take() } else { None }
        })
    }

    /// The window's picture, as far as it is on the display; `None` if it cannot be seen.
    fn screenshot(&self) -> Option<Screenshot> {
        let connection = &self.desktop.connection;
        let size = connection.get_geometry(self.window).ok()?.reply().ok()?;
        let (width, height) = (size.width.min(SCREEN.0), size.height.min(SCREEN.1));
        let format = ImageFormat::Z_PIXMAP;
        let image = connection.get_image(format, self.window, 0, 0, width, height, !0).ok()?;
        let pixels = image.reply().ok()?.data;
        Some(Screenshot { width: width.into(), height: height.into(), pixels })
    }

    /// Moves the mouse to a pixel of the window.
    pub(crate) fn move_to(&self, x: i16, y: i16) {
        self.desktop.fake(MOTION_NOTIFY_EVENT, 0, x, y);
    }

    /// Presses the left button, or lets it go.
    pub(crate) fn press(&self, is_down: bool) {
        let kind = if is_down { BUTTON_PRESS_EVENT } else { BUTTON_RELEASE_EVENT };
        self.desktop.fake(kind, 1, 0, 0);
    }

    /// Clicks at a pixel of the window.
    pub(crate) fn click(&mut self, x: i16, y: i16) {
        self.move_to(x, y);
        self.wait_until_still();
        self.press(true);
        // Seen by a picture, and less than what a press is long that is no click, 0.8 s.
        sleep(2 * GLANCE);
        self.press(false);
        self.wait_until_still();
    }

    /// Strikes the key of a symbol; letters are their own.
    pub(crate) fn strike(&self, symbol: char) {
        self.desktop.key(symbol, true);
        self.desktop.key(symbol, false);
    }

    /// Holds a key while another window has the keyboard and then this one.
    pub(crate) fn come_back_with(&self, symbol: char) {
        self.desktop.focus(self.desktop.root);
        self.desktop.key(symbol, true);
        self.desktop.focus(self.window);
        // Less than what repeats a key, 0.66 s.
        sleep(GLANCE);
        self.desktop.key(symbol, false);
    }

    pub(crate) fn resize(&self, width: u32, height: u32) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.desktop.sync(self.desktop.connection.configure_window(self.window, &size));
    }

    /// Takes the window off the display, or puts it there again.
    pub(crate) fn show(&self, is_shown: bool) {
        let connection = &self.desktop.connection;
        if is_shown {
            self.desktop.sync(connection.map_window(self.window));
        } else {
            self.desktop.sync(connection.unmap_window(self.window));
        }
    }

    /// Says that the window is minimised, or no longer, as a window manager does.
    pub(crate) fn minimize(&self, is_minimized: bool) {
        let Desktop { connection, .. } = self.desktop;
        let hidden = [self.desktop.atom("_NET_WM_STATE_HIDDEN")];
        let states = if is_minimized { &hidden[..] } else { &[] };
        let (mode, state) = (PropMode::REPLACE, self.desktop.atom("_NET_WM_STATE"));
        let atoms = AtomEnum::ATOM;
        self.desktop.sync(connection.change_property32(mode, self.window, state, atoms, states));
    }

    /// The memory that it has, in bytes.
    pub(crate) fn memory(&self) -> u64 {
        self.bytes_of("VmRSS:")
    }

    fn bytes_of(&self, kind: &str) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id()));
        let status = status.expect("it runs on Linux");
        let found = status.lines().find_map(|line| line.strip_prefix(kind));
        let kilobytes = found.and_then(|rest| rest.trim().strip_suffix(" kB"));
        1_024 * kilobytes.and_then(|number| number.parse::<u64>().ok()).expect("a number")
    }

    /// Leaves it so many bytes of its address space that it has not mapped yet, or all.
    pub(crate) fn leave_room(&self, bytes: Option<u64>) {
        let most = bytes.map(|bytes| self.bytes_of("VmSize:") + bytes);
        let most = most.map_or("unlimited".to_owned(), |most| most.to_string());
        let process = self.child.id().to_string();
        // Its soft limit, which may be raised again.
        let limit = format!("--as={most}:");
        let limited = Command::new("prlimit").args(["--pid", &process, &limit]).status();
        assert!(limited.expect("there is prlimit, of util-linux").success());
    }

    /// Closes the window as a window manager does; see [`Session::end`].
    pub(crate) fn close(self) -> Value {
        self.ask_to_close();
        self.end()
    }

    /// Closes the window of a program that said in one line what went wrong before, and gives back what it reported.
    pub(crate) fn close_after(self, failure: &str) -> Value {
        self.ask_to_close();
        self.end_after(failure, 1)
    }

    /// Takes the window away as another program can, of which this one says so in one line, and gives back what it
    /// reported.
    pub(crate) fn destroy(self) -> Value {
        self.desktop.sync(self.desktop.connection.destroy_window(self.window));
        self.end_after("the window was destroyed", 3)
    }

    fn end_after(mut self, failure: &str, status: i32) -> Value {
        let (ended, told) = self.wait();
        assert!(ended.code() == Some(status) && told.lines().count() == 1, "{ended}: {told}");
        assert!(told.contains(failure), "no {failure:?} in {told}");
        self.report()
    }

    fn ask_to_close(&self) {
        let desktop = self.desktop;
        let data = [desktop.atom("WM_DELETE_WINDOW"), CURRENT_TIME, 0, 0, 0];
        let protocols = desktop.atom("WM_PROTOCOLS");
        let message = ClientMessageEvent::new(32, self.window, protocols, data);
        let (window, nobody) = (self.window, EventMask::NO_EVENT);
        desktop.sync(desktop.connection.send_event(false, window, nobody, message));
    }

    /// Waits for its end, which is to be a sound one, and gives back what it reported.
    fn end(mut self) -> Value {
        let (status, told) = self.wait();
        assert!(status.success() && told.is_empty(), "{status}: {told}");
        self.report()
    }

    /// How it ended, and what it said on standard error.
    fn wait(&mut self) -> (ExitStatus, String) {
        let status = wait_for("the end", || self.child.try_wait().expect("it can be waited for"));
        (status, self.read("stderr"))
    }

    fn report(&self) -> Value {
        let printed = self.read("stdout");
        assert!(printed.contains("state hash"), "{printed}");
        read_json(&self.folder.path().join("report.json"))
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.folder.path().join(name)).expect("plain text")
    }
}

impl Drop for Session<'_> {
    fn drop(&mut self) {
        // It usually has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
