"""apron lsp, tried by a client without an editor."""
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import unittest

APRON = os.path.join(os.environ["SMARTSURF_BIN"], "apron")
SOURCE = pathlib.Path(__file__).resolve().parents[3]

PROGRAM = """!include('morphology.aps')
!include('mine.aps')
// The object under each cell.
!register(Object, Größe)
!define(LIMIT, 3)
n = 0
#frame
Object = north(Object) + LIMIT
Größe = erode(Object) + twice(Object)
n = n + 1  // 𝄞 counts
filter.create('k', 3, 3)
Object = filter.do(Object, 'k')
function y = blend(plane a, number share)
  half = a * share
  y = half + n
endfunction
jump(#frame)
"""
MINE = """// Twice the value.
!macro_def
$y = twice($a)
!macro_begin
:t = $a
$y = :t + $a
!macro_end
"""


class Client:
    def __init__(self, *arguments):
        self.process = subprocess.Popen([APRON, "lsp", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.next_id, self.diagnostics = 0, {}

    def send_bytes(self, body):
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def send(self, **message):
        self.send_bytes(json.dumps({"jsonrpc": "2.0", **message}).encode())

    def receive(self):
        length = 0
        while (line := self.process.stdout.readline().strip()) != b"":
            length = int(line.split(b":")[1])
        return json.loads(self.process.stdout.read(length))

    def request(self, method, **params):
        self.next_id += 1
        self.send(id=self.next_id, method=method, params=params)
        return self.answer(self.next_id)

    def answer(self, number):
        while True:
            message = self.receive()
            if message.get("method") == "textDocument/publishDiagnostics":
                self.diagnostics[message["params"]["uri"]] = message["params"]["diagnostics"]
            elif message.get("id") == number:
                return message

    def notify(self, method, **params):
        self.send(method=method, params=params)

    def close(self):
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            try:
                stream.close()
            except BrokenPipeError:
                pass

    def end(self):
        self.request("shutdown")
        self.notify("exit")
        self.process.stdin.close()
        return self.process.wait(10)


class LanguageServer(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="apron lsp ä")))
        (self.folder / "mine.aps").write_text(MINE)
        self.uri, self.mine = (self.folder / "p.aps").as_uri(), (self.folder / "mine.aps").as_uri()
        self.client = Client()
        self.addCleanup(self.client.close)
        capabilities = self.client.request("initialize", capabilities={})["result"]["capabilities"]
        self.assertTrue(capabilities["hoverProvider"] and capabilities["renameProvider"]["prepareProvider"])
        self.client.notify("initialized")
        self.open(PROGRAM)

    def open(self, text, uri=None):
        self.text = text
        self.client.notify("textDocument/didOpen", textDocument={"uri": uri or self.uri, "languageId": "apron", "version": 1, "text": text})

    def change(self, text):
        self.text = text
        self.client.notify("textDocument/didChange", textDocument={"uri": self.uri, "version": 2}, contentChanges=[{"text": text}])

    def at(self, word, occurrence=0, offset=1):
        """The place of a word of the text, columns in UTF-16 units."""
        start = -1
        for _ in range(occurrence + 1):
            start = self.text.index(word, start + 1)
        before = self.text[:start + offset]
        line = before.count("\n")
        return {"line": line, "character": len(before.rsplit("\n", 1)[-1].encode("utf-16-le")) // 2}

    def ask(self, method, word, occurrence=0, offset=1, **more):
        answer = self.client.request("textDocument/" + method, textDocument={"uri": self.uri},
                                     position=self.at(word, occurrence, offset), **more)
        self.assertNotIn("error", answer)
        return answer["result"]

    def slice(self, range_, text):
        lines = text.split("\n")
        line = lines[range_["start"]["line"]].encode("utf-16-le")
        self.assertEqual(range_["start"]["line"], range_["end"]["line"])
        return line[2 * range_["start"]["character"]:2 * range_["end"]["character"]].decode("utf-16-le")

    def sync(self):
        return self.client.request("textDocument/documentSymbol", textDocument={"uri": self.uri})["result"]

    def test_diagnostics_follow_the_text(self):
        self.sync()
        self.assertEqual(self.client.diagnostics[self.uri], [])
        self.change(PROGRAM.replace("+ LIMIT", "+ Limit") + "𝄞 = 1\n")
        self.sync()
        found = self.client.diagnostics[self.uri]
        self.assertIn("Limit", [self.slice(d["range"], self.text) for d in found])
        self.assertTrue(all(d["severity"] == 1 and d["source"] == "apron" for d in found))
        self.change(PROGRAM)
        self.sync()
        self.assertEqual(self.client.diagnostics[self.uri], [])
        # For an included file that is open and has an error in a body that nothing calls.
        self.open(MINE.replace(":t + $a", ":t + $b"), self.mine)
        self.sync()
        self.assertEqual([d["range"]["start"]["line"] for d in self.client.diagnostics[self.mine]][:1], [5])
        self.client.notify("textDocument/didClose", textDocument={"uri": self.mine})
        self.text = PROGRAM
        self.sync()
        self.assertEqual(self.client.diagnostics[self.mine], [])

    def test_hover(self):
        north = self.ask("hover", "north")["contents"]["value"]
        self.assertIn("with 1 argument", north)
        self.assertIn("the value of that neighbour", north)          # the language page's row
        self.assertIn("Instruction `shift`", north)
        erode = self.ask("hover", "erode")["contents"]["value"]
        self.assertIn("function y = erode(a)", erode)
        self.assertIn("smallest value of a cell", erode)             # the library's comment
        self.assertIn("The object under each cell.", self.ask("hover", "Object = north")["contents"]["value"])
        self.assertIn("Twice the value.", self.ask("hover", "twice")["contents"]["value"])
        self.assertIn("searched beside", self.ask("hover", "!include")["contents"]["value"])
        self.assertIn("declares a filter", self.ask("hover", "filter.create")["contents"]["value"])
        self.assertIsNone(self.ask("hover", "= 0"))
        self.assertIsNone(self.client.request("textDocument/hover", textDocument={"uri": self.uri},
                                              position={"line": 10**12, "character": 10**12})["result"])

    def test_every_instruction_has_a_page(self):
        items = self.ask("completion", "n = 0")["items"]
        pages = {item["label"]: item.get("documentation", {}) for item in items}
        missing = [name for name, page in pages.items() if isinstance(page, dict) and page.get("value", "x") == ""]
        self.assertEqual(missing, [])

    def test_completion(self):
        labels = {item["label"] for item in self.ask("completion", "n = 0")["items"]}
        self.assertLessEqual({"Object", "Größe", "n", "twice", "erode", "near.sum", "where", "!include", "#frame", "LIMIT", "k"}, labels)

    def test_completion_knows_every_directive_of_the_manual(self):
        labels = {item["label"] for item in self.ask("completion", "n = 0")["items"]}
        manual = (SOURCE / "docs/apron-language.md").read_text()
        self.assertLessEqual(set(re.findall(r"`(![a-z_0-9]{2,})", manual)), labels)

    def test_definition_and_references(self):
        self.assertEqual(self.slice(self.ask("definition", "Object)")["range"], self.text), "Object")
        self.assertEqual(self.ask("definition", "Object)")["range"]["start"]["line"], 3)
        twice = self.ask("definition", "twice")
        self.assertEqual((twice["uri"], self.slice(twice["range"], MINE)), (self.mine, "twice"))
        self.assertTrue(self.ask("definition", "erode")["uri"].endswith("morphology.aps"))
        self.assertEqual(self.ask("definition", "#frame", 1, 2)["range"]["start"]["line"], 6)
        self.assertEqual(self.ask("definition", "half", 1)["range"]["start"]["line"], 13)
        self.assertEqual(self.ask("definition", "'mine.aps'")["uri"], self.mine)
        self.assertEqual(len(self.ask("references", "LIMIT", context={"includeDeclaration": True})), 2)
        self.assertEqual(len(self.ask("references", "'k'", 0, 2, context={})), 2)

    def apply(self, edits, text):
        lines = text.split("\n")
        for edit in sorted(edits, key=lambda e: (e["range"]["start"]["line"], -e["range"]["start"]["character"])):
            line = lines[edit["range"]["start"]["line"]].encode("utf-16-le")
            lines[edit["range"]["start"]["line"]] = (line[:2 * edit["range"]["start"]["character"]].decode("utf-16-le") + edit["newText"] +
                                                     line[2 * edit["range"]["end"]["character"]:].decode("utf-16-le"))
        return "\n".join(lines)

    def test_rename(self):
        for word, occurrence, offset, new in (("Object", 0, 1, "Ding"), ("Größe", 1, 2, "size"), ("n = n", 0, 0, "counter"),
                                              ("LIMIT", 1, 1, "BOUND"), ("#frame", 0, 2, "again"), ("half", 0, 1, "part"), ("'k'", 0, 2, "kernel")):
            changes = self.ask("rename", word, occurrence, offset, newName=new)["changes"]
            self.assertEqual(list(changes), [self.uri])
            renamed = self.apply(changes[self.uri], PROGRAM)
            self.assertNotEqual(renamed, PROGRAM)
            (self.folder / "q.aps").write_text(renamed)
            check = subprocess.run([APRON, "check", self.folder / "q.aps"], capture_output=True, text=True)
            self.assertEqual(check.returncode, 0, check.stderr)
            old = subprocess.run([APRON, "disasm", self.folder / "q.aps"], capture_output=True, text=True).stdout
            (self.folder / "q.aps").write_text(PROGRAM)
            self.assertEqual(len(old.splitlines()), len(subprocess.run([APRON, "disasm", self.folder / "q.aps"], capture_output=True, text=True).stdout.splitlines()))
        both = self.ask("rename", "twice", newName="double")["changes"]
        self.assertEqual(set(both), {self.uri, self.mine})
        for word, new in (("erode", "shrink"), ("Object", "1x"), ("Object", "Größe"), ("Object", "north"), ("Object", "endfunction"), ("blend", "while"), ("= 0", "x"), ("north", "x")):
            answer = self.client.request("textDocument/rename", textDocument={"uri": self.uri}, position=self.at(word), newName=new)
            self.assertIn("error", answer, (word, new))

    def rename(self, word, new, occurrence=0):
        """The text with the name changed, or the error."""
        answer = self.client.request("textDocument/rename", textDocument={"uri": self.uri}, position=self.at(word, occurrence, 0), newName=new)
        return self.apply(answer["result"]["changes"][self.uri], self.text) if "result" in answer else answer["error"]["message"]

    def test_rename_reaches_elements_that_are_named_by_text(self):
        text = "!create('Q', REGISTER, 3, 2)\nr[Q] = 1\nprintln(res.match(REGISTER, 'Q'), 'Q')\n"
        self.change(text)
        renamed = "!create('Z', REGISTER, 3, 2)\nr[Z] = 1\nprintln(res.match(REGISTER, 'Z'), 'Q')\n"
        for occurrence in range(2):  # where it is declared and used
            self.assertEqual(self.rename("Q", "Z", 1 - occurrence), renamed)
        self.assertEqual(self.rename("Q', REGISTER", "Z"), renamed)

    def test_rename_keeps_what_is_named_by_text_apart_from_names(self):
        text = "sim.slider.add('{0}', -2, 2, 0.6)\nfilter.create('{1}', 3, 3)\n!register(A, B)\nfunction y = f(k)\nprintln('y', k)\ny = k\nendfunction\n" \
               "A = east(A) + sim.slider.get('{0}')\nB = filter.do(A, '{1}') + f(B)\n"
        self.change(text.format("east", "west"))
        self.assertEqual(self.rename("east'", "drift"), text.format("drift", "west"))
        self.assertEqual(self.rename("east'", "drift", 1), text.format("drift", "west"))
        self.assertEqual(self.rename("east(", "drift"), "there is no name of the program here")
        self.change(text.format("east", "k"))
        self.assertEqual(self.rename("k'", "edge"), text.format("east", "edge"))
        self.assertEqual(self.rename("k)", "z"), self.text.replace("f(k", "f(z").replace("y', k", "y', z").replace("y = k", "y = z"))
        self.assertEqual(self.rename("y = f", "v"), self.text.replace("y = ", "v = "))

    def test_rename_reaches_strings_that_are_a_name_of_the_macro(self):
        self.change("!macro_def\nshow($name)\n!macro_begin\n:t = $name\nprintln('$name', ':t', ' $name', :t)\n!macro_end\nn = 3\nshow(n)\n")
        for occurrence in range(3):
            self.assertEqual(self.rename("name", "word", occurrence),
                             self.text.replace("$name", "$word").replace("' $word'", "' $name'"))
        self.assertEqual(self.rename("t = ", "u"), self.text.replace(":t", ":u"))

    def test_rename_refuses_names_that_are_joined(self):
        self.change("!macro_def\nkeep($n)\n!macro_begin\n$n ## _old = $n\n!macro_end\n!register(A, B, A_old, x1, x2)\nx = 1\n"
                    "keep(A)\n!for(j, 1, 2)\n  x ## j = j + x\n!endfor\nprintln(A, B, A_old, x1, x2, x)\n")
        for name, line in (("A", 4), ("A_old", 4), ("x1", 10), ("x2", 10)):
            self.assertRegex(self.rename(name + ",", "Z"), f"^'{name}' may be a part .*p.aps:{line}: rename it by hand$")
        self.assertEqual(self.rename("B", "Z"), self.text.replace("B,", "Z,"))
        self.assertEqual(self.rename("x = 1", "Z"),
                         self.text.replace("\nx = 1", "\nZ = 1").replace("+ x", "+ Z").replace("x)", "Z)"))
        self.assertEqual(self.rename("j,", "k"), self.text.replace("j", "k"))

    def test_rename_refuses_names_that_mean_something_else(self):
        self.change("!macro_def\nset($n)\n!macro_begin\n  L ## $n = 2\n!macro_end\n!register(A)\nq = 1\nL = 5\n!for(j, 0, 1)\n  x ## j = j\n!endfor\n"
                    "set(q)\nprintln(A, Lq, L, x0)\n")
        for name, new, line in (("A)", "Lq", 4), ("q = 1", "A", None), ("L = 5", "x0", 10), ("A)", "x1", 10), ("n)", "L", None), ("j, 0", "x", 10)):
            wanted = f"^'{new}' may be a part .*p.aps:{line}: rename it by hand$" if line else "already|rename it by hand"
            self.assertRegex(self.rename(name, new), wanted, (name, new))
        for name in ("SURFACE_WIDTH", "SURFACE_HEIGHT"):
            self.assertEqual(self.rename("A)", name), f"'{name}' is a constant of every program")
        self.assertEqual(self.rename("A)", "Lz"), self.text.replace("A", "Lz"))

    def test_symbols_and_formatting(self):
        names = {symbol["name"] for symbol in self.sync()}
        self.assertLessEqual({"Object", "Größe", "LIMIT", "n", "frame", "blend", "k"}, names)
        self.assertNotIn("half", names)
        self.change("if(1)\nn=1\nendif")
        edits = self.client.request("textDocument/formatting", textDocument={"uri": self.uri}, options={"tabSize": 2})["result"]
        self.assertEqual(edits[0]["newText"], "if(1)\n  n = 1\nendif\n")
        self.change(edits[0]["newText"])
        self.assertEqual(self.client.request("textDocument/formatting", textDocument={"uri": self.uri}, options={})["result"], [])

    def test_shipped_programs(self):
        """Each has no error, and every name that is used has its definition."""
        for path in sorted((SOURCE / "scripts/tasks").glob("*.aps"))[:8] + [SOURCE / "scripts/case-study/sort.aps"]:
            uri = path.as_uri()
            self.client.notify("textDocument/didOpen", textDocument={"uri": uri, "languageId": "apron", "version": 1, "text": path.read_text()})
            self.client.request("textDocument/documentSymbol", textDocument={"uri": uri})
            self.assertEqual([d for d in self.client.diagnostics[uri] if d["severity"] == 1], [], path)
            self.client.notify("textDocument/didClose", textDocument={"uri": uri})

    def test_bad_input(self):
        client = self.client
        for body, code in ((b"{", -32700), (b"\xff\xfe", -32700), (b"[]", -32600), (b"3", -32600), (b"{}", -32600), (b'{"method": 4}', -32600)):
            client.send_bytes(body)
            self.assertEqual(client.answer(None)["error"]["code"], code, body)
        for method, params, code in (("no/such", {}, -32601), ("textDocument/hover", {}, -32602), ("textDocument/hover", [], -32602),
                                     ("textDocument/hover", {"textDocument": {"uri": 5}}, -32602),
                                     ("textDocument/hover", {"textDocument": {"uri": self.uri}, "position": {"line": "x"}}, -32602),
                                     ("textDocument/definition", {"textDocument": {"uri": "file:///none"}, "position": {"line": 0, "character": 0}}, -32803)):
            client.next_id += 1
            client.send(id=client.next_id, method=method, params=params)
            self.assertEqual(client.answer(client.next_id)["error"]["code"], code, (method, params))
        for method, params in (("textDocument/didOpen", {}), ("textDocument/didChange", {"textDocument": {"uri": "file:///none"}, "contentChanges": 5}),
                               ("$/cancelRequest", {"id": 1}), ("textDocument/didClose", {"textDocument": {"uri": "%zz"}})):
            client.notify(method, **params)
        random_ = random.Random(3)
        for _ in range(60):  # programs damaged at random
            text = list(PROGRAM)
            for _ in range(random_.randrange(1, 12)):
                text[random_.randrange(len(text))] = random_.choice("()!#$:'\\\n,=𝄞ä0x[]\x00")
            self.change("".join(text))
            for method in ("hover", "completion", "definition", "references", "documentHighlight"):
                client.request("textDocument/" + method, textDocument={"uri": self.uri},
                               position={"line": random_.randrange(20), "character": random_.randrange(30)}, context={})
        self.assertEqual(client.end(), 0)

    def test_grammar(self):
        """The editors' grammar is what the generator writes, and it knows every instruction."""
        folder = SOURCE / "editors/vscode"
        written = subprocess.run([sys.executable, SOURCE / "editors/grammar", APRON], capture_output=True, text=True, check=True).stdout
        self.assertEqual(written, (folder / "syntaxes/apron.tmLanguage.json").read_text(), "run editors/grammar")
        grammar = json.loads(written)

        def scope(word):
            for pattern in grammar["patterns"]:
                match = re.search(pattern.get("match", pattern.get("begin")), word)
                if match and match.start() == 0:
                    return pattern["name"], match.end() == len(word)
            return None, False
        for item in self.ask("completion", "n = 0")["items"]:
            label = item["label"]
            if label in ("Object", "Größe", "n", "k", "blend", "LIMIT") or label[0] == "#" or "y" == label:
                continue
            if item["kind"] == 14:
                self.assertEqual(scope(label), ("keyword.control.apron", True), label)
        for word, name in (("near.sum", "support.function.apron"), ("mask.on", "support.function.apron"), ("'text'", "string.quoted.single.apron"),
                           ("// note", "comment.line.double-slash.apron"), ("1.5e-3", "constant.numeric.apron"), ("0x1F", "constant.numeric.apron"),
                           ("#frame", "entity.name.label.apron"), (":#again", "entity.name.label.apron"), ("$y", "variable.parameter.apron"),
                           (":t", "variable.parameter.apron"), ("function", "keyword.control.apron"), ("plane", "storage.type.apron")):
            self.assertEqual(scope(word)[0], name, word)
        for word in ("northern", "mine", "x.near.sum", "Größe"):
            self.assertNotIn(scope(word)[0], ("support.function.apron", "keyword.control.apron"), word)
        package = json.loads((folder / "package.json").read_text())
        for path in [package["main"], *(g["path"] for g in package["contributes"]["grammars"]),
                     *(language["configuration"] for language in package["contributes"]["languages"])]:
            self.assertTrue((folder / path).is_file(), path)

    def test_ends(self):
        self.assertEqual(self.client.end(), 0)
        client = Client("--stdio")
        self.assertEqual(client.request("textDocument/hover")["error"]["code"], -32002)
        client.notify("exit")
        self.assertEqual(client.process.wait(10), 1)
        client.close()
        for stream, status in ((b"", 1), (b"Content-Length: x\r\n\r\n", 2), (b"Content-Length: 99999999999\r\n\r\n", 2), (b"a" * 10000, 2),
                               (b"Content-Length: 20\r\n\r\n{", 1)):
            ended = subprocess.run([APRON, "lsp"], input=stream, capture_output=True, timeout=20)
            self.assertEqual(ended.returncode, status, stream[:30])
            self.assertEqual(ended.stderr.count(b"\n"), 1 if status == 2 else 0)


if __name__ == "__main__":
    unittest.main()
