"""The language server in Neovim, set up by the lines of the language page: its own functions for diagnostics, hover, completion,
definition, rename and formatting, without a terminal."""
import re
import shutil

from programs import *

PROGRAM = """!include('morphology.aps')
!register(Object, Größe)
n = 0
#frame
Object = erode(Object)+n
Größe = north(Object)
jump(#frame)
"""

# Each step waits for what the editor shows, and the results are written as JSON.
STEPS = """
local results = {}
local function wait(name, ready)
  local value
  vim.wait(20000, function() value = ready() return value ~= nil end, 20)
  if value == nil then error('nothing within 20 s: ' .. name) end
  results[name] = value
end
local function place(line, column) vim.api.nvim_win_set_cursor(0, { line, column }) end
local function lines() return table.concat(vim.api.nvim_buf_get_lines(0, 0, -1, true), '\\n') .. '\\n' end

vim.cmd('edit p.aps')
local main = vim.api.nvim_get_current_buf()
wait('client', function() return next(vim.lsp.buf_get_clients(main)) and true end)
results.filetype = vim.bo.filetype

vim.api.nvim_buf_set_lines(0, 4, 5, true, { 'Object = erode(Objekt)+n' })
wait('errors', function()
  local all = vim.diagnostic.get(main)
  if #all > 0 then return vim.tbl_map(function(d) return { d.lnum, d.col, d.message, d.severity } end, all) end
end)
vim.api.nvim_buf_set_lines(0, 4, 5, true, { 'Object = erode(Object)+n' })
wait('repaired', function() if #vim.diagnostic.get(main) == 0 then return true end end)

place(5, 10)
vim.lsp.buf.hover()
wait('hover', function()
  for _, window in ipairs(vim.api.nvim_list_wins()) do
    if vim.api.nvim_win_get_config(window).relative ~= '' then
      return table.concat(vim.api.nvim_buf_get_lines(vim.api.nvim_win_get_buf(window), 0, -1, true), '\\n')
    end
  end
end)

place(6, 8)
wait('completion', function()
  local answers = vim.lsp.buf_request_sync(main, 'textDocument/completion', vim.lsp.util.make_position_params(), 20000)
  for _, answer in pairs(answers or {}) do
    return vim.tbl_map(function(item) return item.word end, vim.lsp.util.text_document_completion_list_to_complete_items(answer.result, 'nor'))
  end
end)

place(6, 1)  -- a name that is not of ASCII
vim.lsp.buf.rename('Ziel')
wait('renamed', function() if lines():find('Ziel = north') then return lines() end end)
vim.lsp.buf[vim.lsp.buf.format and 'format' or 'formatting_sync']()
results.formatted = lines()
place(5, 10)
vim.lsp.buf.definition()
wait('definition', function()
  if vim.api.nvim_get_current_buf() ~= main then
    return { vim.api.nvim_buf_get_name(0), vim.api.nvim_get_current_line() }
  end
end)
vim.fn.writefile({ vim.fn.json_encode(results) }, 'results.json')
"""


class Neovim(ProgramTest):
    def setUp(self):
        super().setUp()
        if shutil.which("nvim") is None:
            self.skipTest("needs Neovim: scripts/setup --editors")

    def test_the_editor_shows_what_the_server_says(self):
        page = (ROOT / "editors/README.md").read_text()
        self.write("init.lua", re.search(r"For Neovim.*?```lua\n(.*?)```", page, re.DOTALL).group(1))
        self.write("steps.lua", STEPS)
        self.write("p.aps", PROGRAM)
        home = [f"XDG_{name}_HOME={self.folder / name.lower()}" for name in ("CONFIG", "DATA", "STATE", "CACHE")]
        status, out, err = self.run_program("env", f"PATH={BIN}:{os.environ['PATH']}", *home, "nvim", "--headless", "-u", "init.lua",
                                            "-c", "luafile steps.lua", "-c", "qall!")
        self.assertEqual(status, 0, out + err)
        self.assertTrue((self.folder / "results.json").exists(), out + err)
        shown = json.loads((self.folder / "results.json").read_text())
        self.assertEqual((shown["client"], shown["filetype"], shown["repaired"]), (True, "apron", True))
        line, column, message, severity = shown["errors"][0]
        self.assertEqual((line, column, severity), (4, 15, 1))
        self.assertIn("'Objekt'", message)
        self.assertIn("The smallest value of a cell and its four neighbours", shown["hover"])
        self.assertIn("north", shown["completion"])
        renamed = PROGRAM.replace("Größe", "Ziel")
        self.assertEqual(shown["renamed"], renamed)
        self.assertEqual(shown["formatted"], renamed.replace(")+n", ") + n"))
        self.assertTrue(shown["definition"][0].endswith("morphology.aps"), shown["definition"])
        self.assertEqual(shown["definition"][1], "function y = erode(a)")


if __name__ == "__main__":
    unittest.main()
