// Speaks the language server protocol with yaml-language-server as an editor does, about decks.

import { spawn, spawnSync } from "node:child_process";
import { readFileSync, readdirSync } from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [program, serverPath] = process.argv.slice(2).map((file) => path.resolve(file));
const root = process.cwd();
const schema = path.join(root, "schema", "deck.schema.json");
const FIRST_LINE = `# yaml-language-server: $schema=${schema}\n`;

// ---- The protocol ----------------------------------------------------------------------------------------------

class LanguageServer {
  constructor() {
    this.process = spawn(process.execPath, [serverPath, "--stdio"], { stdio: ["pipe", "pipe", "inherit"] });
    this.process.stdout.on("data", (chunk) => this.receive(chunk));
    this.buffer = Buffer.alloc(0);
    this.waiting = new Map();
    this.published = new Map();
    this.next = 1;
    this.opened = 0;
  }

  receive(chunk) {
    this.buffer = Buffer.concat([this.buffer, chunk]);
    for (;;) {
      const end = this.buffer.indexOf("\r\n\r\n");
      if (end < 0) return;
      const length = Number(/Content-Length: (\d+)/i.exec(this.buffer.subarray(0, end).toString())[1]);
      if (this.buffer.length < end + 4 + length) return;
      const message = JSON.parse(this.buffer.subarray(end + 4, end + 4 + length).toString());
      this.buffer = this.buffer.subarray(end + 4 + length);
      this.handle(message);
    }
  }

  handle(message) {
    if (message.method && message.id !== undefined) {
      // The server asks for its settings; everything else is granted.
      const settings = { validate: true, hover: true, completion: true, schemaStore: { enable: false } };
      const answers = (message.params?.items ?? []).map(({ section }) => (section === "yaml" ? settings : null));
      const result = message.method === "workspace/configuration" ? answers : null;
      this.send({ jsonrpc: "2.0", id: message.id, result });
    } else if (message.method === "textDocument/publishDiagnostics") {
      this.published.get(message.params.uri)?.(message.params.diagnostics);
    } else if (message.id !== undefined) {
      this.waiting.get(message.id)?.(message);
      this.waiting.delete(message.id);
    }
  }

  send(message) {
    const text = JSON.stringify(message);
    this.process.stdin.write(`Content-Length: ${Buffer.byteLength(text)}\r\n\r\n${text}`);
  }

  request(method, params) {
    const id = this.next++;
    const answer = new Promise((resolve, reject) => {
      this.waiting.set(id, ({ result, error }) => (error ? reject(new Error(error.message)) : resolve(result)));
    });
    this.send({ jsonrpc: "2.0", id, method, params });
    return within(20_000, answer, method);
  }

  notify(method, params) {
    this.send({ jsonrpc: "2.0", method, params });
  }

  async start() {
    await this.request("initialize", {
      processId: process.pid,
      rootUri: pathToFileURL(root).href,
      workspaceFolders: [{ uri: pathToFileURL(root).href, name: "mpm" }],
      capabilities: {
        workspace: { configuration: true },
        textDocument: {
          completion: { completionItem: { documentationFormat: ["markdown"] } },
          hover: { contentFormat: ["markdown"] },
          publishDiagnostics: {},
        },
      },
    });
    this.notify("initialized", {});
    this.notify("workspace/didChangeConfiguration", { settings: {} });
  }

  // Opens a text and returns what the editor would underline.
  async open(name, text) {
    // A name of its own for each, so that late news of a closed one is not taken for news of the next.
    this.opened += 1;
    const uri = pathToFileURL(path.join(root, "inputs", `${this.opened}_${name}`)).href;
    const diagnostics = new Promise((resolve) => this.published.set(uri, resolve));
    this.notify("textDocument/didOpen", { textDocument: { uri, languageId: "yaml", version: 1, text } });
    return { uri, text, diagnostics: await within(20_000, diagnostics, `the diagnostics of ${name}`) };
  }

  close({ uri }) {
    this.published.delete(uri);
    this.notify("textDocument/didClose", { textDocument: { uri } });
  }

  async stop() {
    await this.request("shutdown", null);
    this.notify("exit");
  }
}

function within(milliseconds, promise, what) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`${what}: no answer`)), milliseconds);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

// ---- Checks ----------------------------------------------------------------------------------------------------

let failures = 0;

function check(what, holds, found) {
  console.log(`${holds ? "ok    " : "FAILED"} ${what}`);
  if (!holds) {
    failures += 1;
    console.log(`       found: ${JSON.stringify(found)}`);
  }
}

// The position just behind a piece of a text.
function behind(text, piece) {
  const before = text.slice(0, text.indexOf(piece) + piece.length).split("\n");
  return { line: before.length - 1, character: before.at(-1).length };
}

const DECK = `${FIRST_LINE}version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 0.5}
materials:
  clay:
    model: von-mises
    young: 1e6
    poisson: 0.3
    deviatoric_yield_stress: 20e3
    density: 2000
bodies:
  - name: block
    material: clay
    shape: {type: box, min: [0, 0], max: [2, 2]}
    method: gimp
    points_per_cell: 4
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 20}
`;

async function hovers(server) {
  const deck = await server.open("hover.yaml", DECK);
  const hover = async (piece) => {
    const position = behind(DECK, piece);
    position.character -= 1;
    const answer = await server.request("textDocument/hover", { textDocument: { uri: deck.uri }, position });
    return answer?.contents?.value ?? "";
  };
  check("a good deck is not underlined", deck.diagnostics.length === 0, deck.diagnostics);
  for (const [piece, ...expected] of [
    ["poisson", "Poisson's ratio", "above -1 and below 0.5", "0.3"],
    ["deviatoric_yield_stress", "Deviatoric yield stress", "\\[stress\\]"],
    ["spacing", "Sides of the cells, \\[length\\]; one number, or one entry per axis", "above 0"],
    ["acceleration", "Acceleration at load factor 1", "length/time"],
    ["steps", "Division of the loading into load steps"],
    ["gimp", "Material point method for the points"],
  ]) {
    const text = await hover(piece);
    const holds = expected.every((part) => new RegExp(part.replace(/[()²]/g, ".")).test(text.replaceAll("\\", "")));
    check(`hovering over \`${piece}\` says: ${text.split("\n")[0].slice(0, 70)}`, holds, text);
  }
  server.close(deck);
}

async function completes(server) {
  const complete = async (name, text, piece) => {
    const deck = await server.open(name, text);
    const position = behind(text, piece);
    const params = { textDocument: { uri: deck.uri }, position };
    const answer = await server.request("textDocument/completion", params);
    server.close(deck);
    return (answer.items ?? answer).map(({ label }) => label);
  };
  const includes = (what, found, ...labels) =>
    check(`${what}: ${labels.join(", ")}`, labels.every((label) => found.includes(label)), found);
  const top = await complete("top.yaml", `${FIRST_LINE}version: 1\n`, "version: 1\n");
  includes("completion at the top offers", top, "grid", "materials", "bodies", "boundary_conditions", "steps");
  const material = DECK.replace("    density: 2000\n", "    \n");
  const keys = await complete("material.yaml", material, "20e3\n    ");
  includes("completion in a material offers", keys, "density");
  const method = DECK.replace("method: gimp", "method: ");
  includes("completion of a method offers", await complete("method.yaml", method, "method: "), "mpm", "gimp", "cpdi2");
  const model = DECK.replace("model: von-mises", "model: ");
  includes("completion of a model offers", await complete("model.yaml", model, "model: "), "hencky", "von-mises");
  const body = DECK.replace("    points_per_cell: 4\n", "    \n");
  const ofBody = await complete("body.yaml", body, "gimp\n    ");
  includes("completion in a body offers", ofBody, "points_per_cell", "point_spacing", "domain_update");
}

async function underlines(server) {
  for (const [wrong, right, message] of [
    ["young", "yuong", /yuong/],
    ["steps: {count", "steps: {cuont", /cuont/],
    ["poisson: 0.3", "poisson: 0.7", /0\.5/],
    ["method: gimp", "method: gmp", /mpm/],
    ["spacing: 0.5", "spacing: wrong", /number|array|pattern/i],
  ]) {
    const text = DECK.replace(wrong, right);
    const deck = await server.open("wrong.yaml", text);
    const line = behind(text, right).line;
    const found = deck.diagnostics.find((d) => message.test(d.message) && d.range.start.line === line);
    check(`\`${right}\` is underlined: ${found?.message?.split("\n")[0]}`, found !== undefined, deck.diagnostics);
    server.close(deck);
  }
}

// ---- Verdicts --------------------------------------------------------------------------------------------------

// What the program says about a deck; null where it cannot be compared.
function verdictOfProgram(file, text) {
  const run = spawnSync(program, ["check", "--format", "json", file], { cwd: root, encoding: "utf8" });
  const { diagnostics } = JSON.parse(run.stdout);
  const errors = diagnostics.filter(({ severity }) => severity === "error");
  // What is not text or not YAML has no shape; an editor marks it by other means.
  if (errors.some(({ gate }) => gate === "text")) return null;
  const shape = errors.filter(({ gate }) => gate === "shape");
  // The schema cannot know what a parameter becomes.
  const known = shape.filter(({ line, notes }) => !notes.some((note) => note.includes("${")));
  if (known.length < shape.length) return null;
  return { accepted: known.length === 0, lines: known.map(({ line }) => line) };
}

async function verdicts(server) {
  const folders = ["inputs", "tests/decks", "tests/decks/build"];
  const files = folders.flatMap((folder) =>
    readdirSync(path.join(root, folder)).filter((f) => f.endsWith(".yaml")).sort().map((f) => path.join(folder, f)));
  // Every sixth deck represents the others, unless `tests/run --long` asks for all.
  const chosen = process.env.MPM_LONG ? files : files.filter((_, number) => number % 6 === 0);
  const counts = { compared: 0, refused: 0, "not comparable": 0 };
  for (const file of chosen) {
    const bytes = readFileSync(path.join(root, file));
    const ofProgram = verdictOfProgram(file, bytes);
    if (ofProgram === null) {
      counts["not comparable"] += 1;
      continue;
    }
    const text = bytes.toString("utf8").replace(/^\uFEFF/, "").replace(/^# yaml-language-server.*\n/, "");
    const shift = bytes.toString("utf8").startsWith("# yaml-language-server") ? 0 : 1;
    const deck = await server.open("verdict.yaml", FIRST_LINE + text);
    const accepted = deck.diagnostics.length === 0;
    counts.compared += 1;
    counts.refused += accepted ? 0 : 1;
    if (accepted !== ofProgram.accepted) {
      check(`${file}: the server and the program agree`, false, { ofProgram, server: deck.diagnostics });
    } else if (!accepted) {
      const lines = deck.diagnostics.map(({ range }) => range.start.line + 1 - shift);
      const meet = ofProgram.lines.some((line) => lines.includes(line));
      if (!meet) check(`${file}: underlined where the program points`, false, { ofProgram, server: deck.diagnostics });
    }
    server.close(deck);
  }
  console.log(`ok     ${counts.compared} decks have the same verdict of both (${counts.refused} refused); ` +
    `${counts["not comparable"]} are no YAML, or refused for what a parameter becomes`);
}

const server = new LanguageServer();
await server.start();
await hovers(server);
await completes(server);
await underlines(server);
await verdicts(server);
await server.stop();
console.log(failures === 0 ? "all as it should be" : `${failures} failures`);
process.exit(failures === 0 ? 0 : 1);
