// Starts `apron lsp` for the .aps files of a window.
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const settings = workspace.getConfiguration("apron");
  const args = ["lsp", "--size", settings.get("size")];
  for (const folder of settings.get("include")) args.push("-I", folder);
  client = new LanguageClient("apron", "APRON", { command: settings.get("program"), args },
    { documentSelector: [{ scheme: "file", language: "apron" }] });
  return client.start();
};

exports.deactivate = () => client && client.stop();
