//! Headless browser, driven by the WebDriver protocol (W3C) over plain HTTP. Also used by `tests/cli` and `host/wasm/tests`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Without a sandbox, which needs privileges that containers may lack, and without network access by the browser
/// itself.
const ARGUMENTS: &[&str] = &[
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--hide-scrollbars",
];

/// Chromium session.
pub(crate) struct Browser {
    driver: Child,
    port: u16,
    session: String,
    _profile: TempDir,
}

#[allow(dead_code, reason = "each test program uses only some methods")]
impl Browser {
    /// Start a session. `None` if ChromeDriver or Chromium is not installed.
    pub(crate) fn start(width: u32, height: u32) -> Option<Self> {
        Command::new("chromium")
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .ok()?;
        let mut command = Command::new("chromedriver");
        command
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut driver = command.spawn().ok()?;
        // ChromeDriver was started successfully on port 12345.
        let lines = BufReader::new(driver.stdout.take().unwrap()).lines();
        let port = lines.map_while(Result::ok).find_map(|line| {
            let (_, port) = line.split_once("started successfully on port ")?;
            port.trim_end_matches('.').parse().ok()
        });
        let profile = TempDir::new().unwrap();
        let mut browser = Self {
            driver,
            port: port.expect("chromedriver says its port"),
            session: String::new(),
            _profile: profile,
        };
        let folder = format!("--user-data-dir={}", browser._profile.path().display());
        let size = format!("--window-size={width},{height}");
        let arguments: Vec<&str> = ARGUMENTS
            .iter()
            .copied()
            .chain([folder.as_str(), &size])
            .collect();
        let options = json!({ "args": arguments, "binary": "/usr/bin/chromium" });
        let all =
            json!({ "goog:chromeOptions": options, "goog:loggingPrefs": { "browser": "ALL" } });
        let asked = json!({ "capabilities": { "alwaysMatch": all } });
        let session = browser.ask("POST", "/session", &asked);
        browser.session = session["sessionId"].as_str().unwrap().to_owned();
        Some(browser)
    }

    fn ask(&self, method: &str, path: &str, body: &Value) -> Value {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        let body = if method == "POST" {
            body.to_string()
        } else {
            String::new()
        };
        let request = format!(
            "{method} {path} HTTP/1.1\r\nHost: localhost:{}\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            self.port,
            body.len()
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut reader = BufReader::new(stream);
        let mut length = 0;
        loop {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("content-length")
            {
                length = value.trim().parse().unwrap();
            }
            if line.trim().is_empty() {
                break;
            }
        }
        let mut text = vec![0; length];
        reader.read_exact(&mut text).unwrap();
        let answer: Value = serde_json::from_slice(&text).unwrap();
        let value = answer["value"].clone();
        assert!(value["error"].is_null(), "{method} {path}: {value}");
        value
    }

    fn of_session(&self, path: &str, body: &Value) -> Value {
        self.ask("POST", &format!("/session/{}{path}", self.session), body)
    }

    pub(crate) fn open(&self, url: &str) {
        self.of_session("/url", &json!({ "url": url }));
    }

    /// Run a function body in the page and return its result.
    pub(crate) fn run(&self, script: &str) -> Value {
        self.of_session("/execute/sync", &json!({ "script": script, "args": [] }))
    }

    pub(crate) fn text(&self, id: &str) -> String {
        let text = self.run(&format!(
            "return document.getElementById({id:?}).textContent"
        ));
        text.as_str().unwrap().to_owned()
    }

    /// Wait until a condition holds in the page.
    pub(crate) fn wait(&self, condition: &str) {
        let begun = Instant::now();
        while self.run(&format!("return Boolean({condition})")) != true {
            assert!(
                begun.elapsed() < Duration::from_secs(30),
                "never: {condition}"
            );
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Choose files in the file input `id`, in place of those chosen before.
    pub(crate) fn choose(&self, id: &str, paths: &[PathBuf]) {
        self.run(&format!("document.getElementById({id:?}).value = ''"));
        let by_id = json!({ "using": "css selector", "value": format!("#{id}") });
        let element = self.of_session("/element", &by_id);
        let reference = element.as_object().and_then(|all| all.values().next());
        let reference = reference.and_then(Value::as_str).unwrap();
        let names: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        let typed = json!({ "text": names.join("\n") });
        self.of_session(&format!("/element/{reference}/value"), &typed);
    }

    pub(crate) fn press(&self, key: &str) {
        let down = json!({ "type": "keyDown", "value": key });
        let up = json!({ "type": "keyUp", "value": key });
        let keys = json!({ "type": "key", "id": "keyboard", "actions": [down, up] });
        self.of_session("/actions", &json!({ "actions": [keys] }));
    }

    /// Run a command of the Chrome DevTools protocol, for example to emulate a dark or small screen.
    pub(crate) fn command(&self, name: &str, parameters: &Value) {
        self.of_session(
            "/goog/cdp/execute",
            &json!({ "cmd": name, "params": parameters }),
        );
    }

    /// Console messages since the last call: script errors and failed loads.
    pub(crate) fn console(&self) -> Vec<Value> {
        let messages = self.of_session("/se/log", &json!({ "type": "browser" }));
        messages.as_array().unwrap().clone()
    }

    /// Screenshot of the window, PNG in base64.
    pub(crate) fn screenshot(&self) -> String {
        let path = format!("/session/{}/screenshot", self.session);
        self.ask("GET", &path, &Value::Null)
            .as_str()
            .unwrap()
            .to_owned()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Also after a failed test, since Chromium would otherwise keep running. Errors are irrelevant here.
        let end = format!(
            "DELETE /session/{} HTTP/1.1\r\nHost: localhost:{}\r\nConnection: close\r\n\r\n",
            self.session, self.port
        );
        if let Ok(mut stream) = TcpStream::connect(("127.0.0.1", self.port)) {
            let _ = stream.set_read_timeout(Some(Duration::from_secs(10)));
            let _ = stream.write_all(end.as_bytes());
            let _ = stream.read_to_end(&mut Vec::new());
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
