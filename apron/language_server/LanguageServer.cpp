#include "apron/language_server/LanguageServer.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "apron/compiler/BodyCheck.h"
#include "apron/compiler/Builtins.h"
#include "apron/compiler/Compiler.h"
#include "apron/language_server/InstructionPages.h"
#include "apron/language_server/MessageStream.h"
#include "apron/language_server/SourceIndex.h"
#include "apron/syntax/FileReader.h"
#include "apron/syntax/Formatter.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/Token.h"

namespace apron::language_server {
namespace {

using nlohmann::json;

// Codes of JSON-RPC and of the protocol.
enum class ErrorCode {
  kParseError = -32700,
  kInvalidRequest = -32600,
  kMethodNotFound = -32601,
  kInvalidParameters = -32602,
  kInternalError = -32603,
  kNotInitialized = -32002,
  kRequestFailed = -32803,
};

struct RequestError {
  ErrorCode code;
  std::string message;
};

[[noreturn]] void refuse(ErrorCode code, std::string message) {
  throw RequestError{code, std::move(message)};
}

// ---- URIs and positions

std::string path_of(const std::string& uri) {
  constexpr std::string_view kScheme = "file://";
  if (!uri.starts_with(kScheme)) return uri;
  std::string path;
  for (std::size_t i = kScheme.size(); i < uri.size(); ++i) {
    const char* const digits = uri.data() + i + 1;
    unsigned code = 0;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2) {
      path += static_cast<char>(code);
      i += 2;
    } else {
      path += uri[i];
    }
  }
  return path;
}

std::string uri_of(const std::string& path) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string uri = "file://";
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || std::string_view("/-._~").find(c) != std::string_view::npos)
      uri += c;
    else
      uri += {'%', kDigits[byte >> 4U], kDigits[byte & 15U]};
  }
  return uri;
}

// The protocol counts columns in UTF-16 units from 0, we in characters from 1.
std::uint32_t utf16_units(char lead) { return (static_cast<unsigned char>(lead) & 0xF8U) == 0xF0U ? 2 : 1; }
bool begins_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }

std::uint32_t to_character(std::string_view line, std::uint64_t utf16) {
  std::uint32_t column = 1;
  std::uint64_t units = 0;
  for (const char c : line) {
    if (!begins_character(c)) continue;
    if (units >= utf16) break;
    units += utf16_units(c);
    ++column;
  }
  return column;
}

std::uint32_t to_utf16(std::string_view line, std::uint32_t column) {
  std::uint32_t at = 1, units = 0;
  for (const char c : line) {
    if (!begins_character(c)) continue;
    if (at >= column) break;
    units += utf16_units(c);
    ++at;
  }
  return units;
}

json range_of(const syntax::SourceManager& sources, const syntax::Location& at, std::uint32_t length) {
  const std::string_view text = sources.line_text(at.file, at.line);
  const std::uint32_t line = at.line > 0 ? at.line - 1 : 0;
  return {{"start", {{"line", line}, {"character", to_utf16(text, at.column)}}},
          {"end", {{"line", line}, {"character", to_utf16(text, at.column + length)}}}};
}

// The word or symbol that begins at a column, in characters.
std::uint32_t word_length(std::string_view line, std::uint32_t column) {
  std::uint32_t at = 0, length = 0;
  for (const char c : line) {
    if (begins_character(c)) ++at;
    if (at < column) continue;
    const bool in_word =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.' || (c & 0x80) != 0;
    if (!in_word) break;
    if (begins_character(c)) ++length;
  }
  return std::max(length, 1U);
}

// ---- documents

// The open documents, and all other files from the disk.
class DocumentReader final : public syntax::FileReader {
 public:
  explicit DocumentReader(const std::map<std::string, std::string>& open) : open_(open) {}
  std::optional<std::string> read(const std::string& path) override {
    const auto found = open_.find(path);
    return found != open_.end() ? std::optional(found->second) : disk_.read(path);
  }

 private:
  const std::map<std::string, std::string>& open_;
  syntax::DiskReader disk_;
};

struct Document {
  syntax::SourceManager sources;
  std::vector<syntax::Diagnostic> diagnostics;  // errors and warnings
  SourceIndex index;
};

// How a kind of symbol is called, and its numbers in the protocol.
struct SymbolKind {
  const char* word;
  int completion, symbol;
};
SymbolKind kind_of(const Symbol& symbol) {
  switch (symbol.kind) {
    case Symbol::Kind::kRegister:
      return {"register", 6, 18};  // variable, array
    case Symbol::Kind::kScalar:
      return {"scalar", 6, 13};  // variable
    case Symbol::Kind::kMacro:
      return {"macro", 3, 12};  // function
    case Symbol::Kind::kFunction:
      return {"function", 3, 12};  // function
    case Symbol::Kind::kLabel:
      return {"label", 18, 20};  // reference, key
    case Symbol::Kind::kDefine:
      return {"constant", 21, 14};  // constant
    case Symbol::Kind::kParameter:
      return {"parameter", 6, 13};  // variable
    case Symbol::Kind::kFilter:
      return {"filter", 6, 13};  // variable
    case Symbol::Kind::kClass:
      return {"class", 7, 5};  // class
  }
  return {};
}

// ---- the server

class LanguageServer {
 public:
  LanguageServer(const ServerOptions& options, std::istream& in, std::ostream& out)
      : options_(options), stream_(in, out) {}

  int run() {
    while (!exit_status_) {
      const std::optional<std::string> text = stream_.read();
      if (!text) return 1;
      handle(*text);
    }
    return *exit_status_;
  }

 private:
  struct Place {  // of a request
    Document& document;
    std::uint32_t line = 0, column = 0;
  };

  void send(const json& message) {
    stream_.write(message.dump(-1, ' ', false, json::error_handler_t::replace));
  }
  void notify(const char* method, json params) {
    send({{"jsonrpc", "2.0"}, {"method", method}, {"params", std::move(params)}});
  }
  void answer(const json& id, json result) {
    send({{"jsonrpc", "2.0"}, {"id", id}, {"result", std::move(result)}});
  }
  void answer_error(const json& id, ErrorCode code, const std::string& message) {
    send({{"jsonrpc", "2.0"},
          {"id", id},
          {"error", {{"code", static_cast<int>(code)}, {"message", message}}}});
  }

  void handle(const std::string& text) {
    const json message = json::parse(text, nullptr, false);
    if (message.is_discarded())
      return answer_error(nullptr, ErrorCode::kParseError, "the message is not JSON");
    if (!message.is_object() || !message.contains("method") || !message["method"].is_string()) {
      if (message.is_object() && (message.contains("result") || message.contains("error")))
        return;  // an answer
      return answer_error(nullptr, ErrorCode::kInvalidRequest, "the message is no request");
    }
    const std::string method = message["method"];
    const bool is_request = message.contains("id");
    const json id = is_request ? message["id"] : json();
    const json params = message.contains("params") ? message["params"] : json::object();
    try {
      json result = dispatch(method, params, is_request);
      if (is_request) answer(id, std::move(result));
    } catch (const RequestError& error) {
      if (is_request) answer_error(id, error.code, error.message);
    } catch (const json::exception& error) {
      if (is_request) answer_error(id, ErrorCode::kInvalidParameters, error.what());
    } catch (const std::exception& error) {
      if (is_request) answer_error(id, ErrorCode::kInternalError, error.what());
    }
  }

  json dispatch(const std::string& method, const json& params, bool is_request) {
    if (method == "exit") {
      exit_status_ = is_shut_down_ ? 0 : 1;
      return {};
    }
    if (method == "initialize") return initialize();
    if (!is_initialized_) {
      if (!is_request) return {};
      refuse(ErrorCode::kNotInitialized, "initialize comes first");
    }
    if (is_shut_down_) refuse(ErrorCode::kInvalidRequest, "the server is shut down");
    using Handler = json (LanguageServer::*)(const json&);
    static const std::map<std::string, Handler, std::less<>> kHandlers{
        {"textDocument/didOpen", &LanguageServer::did_open},
        {"textDocument/didChange", &LanguageServer::did_change},
        {"textDocument/didClose", &LanguageServer::did_close},
        {"textDocument/hover", &LanguageServer::hover},
        {"textDocument/completion", &LanguageServer::complete},
        {"textDocument/definition", &LanguageServer::definition},
        {"textDocument/references", &LanguageServer::references},
        {"textDocument/prepareRename", &LanguageServer::prepare_rename},
        {"textDocument/rename", &LanguageServer::rename},
        {"textDocument/formatting", &LanguageServer::format},
        {"textDocument/documentSymbol", &LanguageServer::list_symbols},
    };
    if (method == "shutdown") {
      is_shut_down_ = true;
      return nullptr;
    }
    const auto handler = kHandlers.find(method);
    if (handler != kHandlers.end()) return (this->*handler->second)(params);
    if (is_request) refuse(ErrorCode::kMethodNotFound, "there is no method '" + method + "'");
    return {};
  }

  json initialize() {
    is_initialized_ = true;
    constexpr int kFullText = 1;
    return {{"serverInfo", {{"name", "apron"}, {"version", SMARTSURF_VERSION}}},
            {"capabilities",
             {{"positionEncoding", "utf-16"},
              {"textDocumentSync", {{"openClose", true}, {"change", kFullText}}},
              {"hoverProvider", true},
              {"completionProvider", {{"triggerCharacters", {".", "!", "#", "$", ":"}}}},
              {"definitionProvider", true},
              {"referencesProvider", true},
              {"renameProvider", {{"prepareProvider", true}}},
              {"documentFormattingProvider", true},
              {"documentSymbolProvider", true}}}};
  }

  // ---- documents ----

  json did_open(const json& params) {
    const std::string path = path_of(params.at("textDocument").at("uri"));
    open_[path] = params.at("textDocument").at("text").get<std::string>();
    recompile();
    return {};
  }
  json did_change(const json& params) {
    const std::string path = path_of(params.at("textDocument").at("uri"));
    const json& changes = params.at("contentChanges");
    if (!open_.contains(path) || !changes.is_array() || changes.empty()) return {};
    for (const json& change : changes)
      if (!change.contains("range")) open_[path] = change.at("text").get<std::string>();
    recompile();
    return {};
  }
  json did_close(const json& params) {
    const std::string path = path_of(params.at("textDocument").at("uri"));
    open_.erase(path);
    documents_.erase(path);
    recompile();
    return {};
  }

  // An open file may be included by another one: all are compiled.
  void recompile() {
    std::map<std::string, json> by_file;
    for (const auto& [path, text] : open_) {
      documents_[path] = compile(path);
      by_file.try_emplace(path, json::array());
    }
    std::set<std::string> seen;
    for (const auto& [path, document] : documents_)
      for (const syntax::Diagnostic& diagnostic : document.diagnostics) {
        const std::string& file = document.sources.file(diagnostic.location.file).name;
        json one = to_json(document, diagnostic);
        if (seen.insert(file + one.dump()).second)
          by_file.try_emplace(file, json::array()).first->second.push_back(one);
      }
    for (const std::string& file : published_) by_file.try_emplace(file, json::array());
    published_.clear();
    for (auto& [file, diagnostics] : by_file) {
      if (!diagnostics.empty()) published_.insert(file);
      notify("textDocument/publishDiagnostics",
             {{"uri", uri_of(file)}, {"diagnostics", std::move(diagnostics)}});
    }
  }

  Document compile(const std::string& path) {
    compiler::CompileOptions options;
    options.file = path;
    options.width = options_.width;
    options.height = options_.height;
    options.include_paths = options_.include_paths;
    options.library_path = options_.library_path;
    DocumentReader reader(open_);
    compiler::CompileResult result = compiler::compile(options, reader);
    Document document;
    document.diagnostics = std::move(result.diagnostics);
    const auto append = [&](const std::vector<syntax::Diagnostic>& more) {
      document.diagnostics.insert(document.diagnostics.end(), more.begin(), more.end());
    };
    append(result.warnings);
    if (result.program) append(compiler::check_macro_bodies(options, reader).diagnostics);
    document.index = SourceIndex(result.sources);
    document.sources = std::move(result.sources);
    std::erase_if(document.diagnostics, [&](const syntax::Diagnostic& d) {
      return d.location.file >= document.sources.file_count();
    });
    return document;
  }

  json to_json(const Document& document, const syntax::Diagnostic& diagnostic) {
    constexpr int kError = 1, kWarning = 2;
    syntax::Location at = diagnostic.location;
    at.column = std::max(at.column, 1U);
    const std::string_view line = document.sources.line_text(at.file, at.line);
    json related = json::array();
    const auto add_related = [&](const syntax::Location& place, const std::string& message) {
      if (place.file < document.sources.file_count())
        related.push_back({{"location",
                            {{"uri", uri_of(document.sources.file(place.file).name)},
                             {"range", range_of(document.sources, place, 1)}}},
                           {"message", message}});
    };
    for (const syntax::Note& note : diagnostic.notes) add_related(note.location, note.message);
    for (std::uint32_t expansion = at.expansion; expansion != 0;) {
      const syntax::ExpansionInfo& info = document.sources.expansion(expansion);
      add_related(info.call, (info.is_function ? "in the call of " : "in the expansion of ") + info.macro);
      expansion = info.call.expansion;
    }
    return {{"range", range_of(document.sources, at, word_length(line, at.column))},
            {"severity", diagnostic.is_warning ? kWarning : kError},
            {"source", "apron"},
            {"message", diagnostic.message},
            {"relatedInformation", related}};
  }

  Document& document_of(const json& params) {
    const std::string path = path_of(params.at("textDocument").at("uri"));
    const auto found = documents_.find(path);
    if (found == documents_.end()) refuse(ErrorCode::kRequestFailed, path + " is not open");
    return found->second;
  }
  Place place_of(const json& params) {
    Document& document = document_of(params);
    const auto line = params.at("position").at("line").get<std::uint64_t>();
    const auto character = params.at("position").at("character").get<std::uint64_t>();
    const auto number = static_cast<std::uint32_t>(std::min<std::uint64_t>(line, UINT32_MAX - 1) + 1);
    return {document, number, to_character(document.sources.line_text(0, number), character)};
  }

  // ---- requests ----

  json hover(const json& params) {
    const Place place = place_of(params);
    const SourceIndex& index = place.document.index;
    const Occurrence* const occurrence = index.find(0, place.line, place.column);
    std::string text;
    syntax::Location at{0, place.line, 0, 0};
    std::uint32_t length = 0;
    if (occurrence != nullptr) {
      const Symbol& symbol = index.symbols()[occurrence->symbol];
      text = "```apron\n" + symbol.text + "\n```\n" + kind_of(symbol).word + " `" + symbol.name + "`";
      if (symbol.location.file != 0) text += " of " + place.document.sources.file(symbol.location.file).name;
      if (!symbol.comment.empty()) text += "\n\n" + symbol.comment;
      at = occurrence->location;
      length = occurrence->length;
    } else {
      const std::string name = index.name_at(0, place.line, place.column, at.column);
      if (name.empty()) return nullptr;
      text = instruction_page(name);
      if (text.empty() && name.front() == '!') text = instruction_page(name.substr(1));
      length = character_count(name);
    }
    if (text.empty()) return nullptr;
    return {{"contents", {{"kind", "markdown"}, {"value", text}}},
            {"range", range_of(place.document.sources, at, length)}};
  }

  json complete(const json& params) {
    const Place place = place_of(params);
    constexpr int kFunction = 3, kKeyword = 14;
    json items = json::array();
    std::set<std::string> seen;
    for (const Symbol& symbol : place.document.index.symbols()) {
      const std::string sigil = symbol.kind == Symbol::Kind::kLabel ? "#" : "";
      if (!seen.insert(sigil + symbol.name).second) continue;
      json item = {
          {"label", sigil + symbol.name}, {"kind", kind_of(symbol).completion}, {"detail", symbol.text}};
      if (!symbol.comment.empty()) item["documentation"] = symbol.comment;
      items.push_back(std::move(item));
    }
    for (const std::string& name : compiler::builtin_names()) {
      if (!seen.insert(name).second) continue;
      const compiler::Builtin& builtin = *compiler::find_builtin(name);
      const bool block = builtin.opened_block() || builtin.closed_block();
      items.push_back({{"label", name},
                       {"kind", block ? kKeyword : kFunction},
                       {"documentation", {{"kind", "markdown"}, {"value", instruction_page(name)}}}});
    }
    for (const std::string& directive : syntax::Preprocessor::directive_names())
      items.push_back({{"label", directive}, {"kind", kKeyword}});
    return {{"isIncomplete", false}, {"items", items}};
  }

  json location_json(const Document& document, const syntax::Location& at, std::uint32_t length) const {
    return {{"uri", uri_of(document.sources.file(at.file).name)},
            {"range", range_of(document.sources, at, length)}};
  }

  json definition(const json& params) {
    const Place place = place_of(params);
    const Occurrence* const occurrence = place.document.index.find(0, place.line, place.column);
    if (occurrence == nullptr) return included_file(place);
    const Symbol& symbol = place.document.index.symbols()[occurrence->symbol];
    return location_json(place.document, symbol.location, character_count(symbol.name));
  }

  // The file that a line includes.
  json included_file(const Place& place) {
    for (std::uint32_t file = 1; file < place.document.sources.file_count(); ++file) {
      const syntax::Location& from = place.document.sources.file(file).included_from;
      if (from.file == 0 && from.line == place.line) return location_json(place.document, {file, 1, 1, 0}, 0);
    }
    return nullptr;
  }

  json references(const json& params) {
    const Place place = place_of(params);
    const Occurrence* const occurrence = place.document.index.find(0, place.line, place.column);
    json all = json::array();
    if (occurrence == nullptr) return all;
    for (const Occurrence& other : place.document.index.occurrences())
      if (other.symbol == occurrence->symbol)
        all.push_back(location_json(place.document, other.location, other.length));
    return all;
  }

  bool is_of_library(const Document& document, std::uint32_t file) const {
    return !options_.library_path.empty() &&
           document.sources.file(file).name.starts_with(options_.library_path);
  }

  const Occurrence& renamed(const Place& place) {
    const Occurrence* const occurrence = place.document.index.find(0, place.line, place.column);
    if (occurrence == nullptr) refuse(ErrorCode::kRequestFailed, "there is no name of the program here");
    const Symbol& symbol = place.document.index.symbols()[occurrence->symbol];
    if (is_of_library(place.document, symbol.location.file))
      refuse(ErrorCode::kRequestFailed, "'" + symbol.name + "' is declared by the library");
    return *occurrence;
  }

  json prepare_rename(const json& params) {
    const Place place = place_of(params);
    const Occurrence& occurrence = renamed(place);
    return range_of(place.document.sources, occurrence.location, occurrence.length);
  }

  json rename(const json& params) {
    const Place place = place_of(params);
    const auto name = params.at("newName").get<std::string>();
    const Occurrence& occurrence = renamed(place);
    const SourceIndex& index = place.document.index;
    const Symbol& symbol = index.symbols()[occurrence.symbol];
    const bool is_word = !name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) == 0 &&
                         std::ranges::all_of(name, [](char c) {
                           return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.' ||
                                  (static_cast<unsigned char>(c) & 0x80U) != 0;
                         });
    if (!is_word)
      refuse(ErrorCode::kRequestFailed,
             "'" + name + "' is not a name: letters, digits, _ and dots, no digit first");
    const bool is_macro = symbol.kind == Symbol::Kind::kMacro || symbol.kind == Symbol::Kind::kFunction;
    if (!is_macro && symbol.kind != Symbol::Kind::kLabel && compiler::find_builtin(name) != nullptr)
      refuse(ErrorCode::kRequestFailed, "'" + name + "' is an instruction");
    if (symbol.kind != Symbol::Kind::kLabel && syntax::is_keyword(name))
      refuse(ErrorCode::kRequestFailed, "'" + name + "' is a keyword");
    for (const Symbol& other : index.symbols())
      if (other.name == name &&
          (other.kind == Symbol::Kind::kLabel) == (symbol.kind == Symbol::Kind::kLabel) &&
          (other.scope == symbol.scope || other.scope == 0 || symbol.scope == 0))
        refuse(ErrorCode::kRequestFailed,
               "there is a " + std::string(kind_of(other).word) + " '" + name + "' already");
    if (name == syntax::kWidthName || name == syntax::kHeightName)
      refuse(ErrorCode::kRequestFailed, "'" + name + "' is a constant of every program");
    for (const std::string& one : {symbol.name, name})
      if (const syntax::Location* const join = index.find_join(symbol, one))
        refuse(ErrorCode::kRequestFailed, "'" + one + "' may be a part of a name that ## joins, or one, at " +
                                              place.document.sources.file(join->file).name + ":" +
                                              std::to_string(join->line) + ": rename it by hand");
    std::map<std::string, json> changes;
    for (const Occurrence& other : index.occurrences()) {
      if (other.symbol != occurrence.symbol || is_of_library(place.document, other.location.file)) continue;
      const std::string uri = uri_of(place.document.sources.file(other.location.file).name);
      changes.try_emplace(uri, json::array())
          .first->second.push_back(
              {{"range", range_of(place.document.sources, other.location, other.length)}, {"newText", name}});
    }
    return {{"changes", changes}};
  }

  json format(const json& params) {
    const Document& document = document_of(params);
    const std::string& text = document.sources.file(0).text;
    const std::string formatted = syntax::format_source(text);
    if (formatted == text) return json::array();
    const auto lines = static_cast<std::uint32_t>(std::ranges::count(text, '\n')) + 1;
    return json::array(
        {{{"range",
           {{"start", {{"line", 0}, {"character", 0}}}, {"end", {{"line", lines}, {"character", 0}}}}},
          {"newText", formatted}}});
  }

  json list_symbols(const json& params) {
    const Document& document = document_of(params);
    json all = json::array();
    for (const Symbol& symbol : document.index.symbols()) {
      if (symbol.location.file != 0 || symbol.scope != 0) continue;
      const json range = range_of(document.sources, symbol.location, character_count(symbol.name));
      all.push_back({{"name", symbol.name},
                     {"kind", kind_of(symbol).symbol},
                     {"detail", symbol.text},
                     {"range", range},
                     {"selectionRange", range}});
    }
    return all;
  }

  const ServerOptions& options_;
  MessageStream stream_;
  std::map<std::string, std::string> open_;  // by path
  std::map<std::string, Document> documents_;
  std::set<std::string> published_;  // files with diagnostics
  bool is_initialized_ = false, is_shut_down_ = false;
  std::optional<int> exit_status_;
};

}  // namespace

int run_language_server(const ServerOptions& options, std::istream& in, std::ostream& out) {
  return LanguageServer(options, in, out).run();
}

}  // namespace apron::language_server
