#include "apron/run/cli/Repl.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string_view>
#include <utility>

#include "apron/compiler/Builtins.h"
#include "apron/compiler/Compiler.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/syntax/Lexer.h"
#include "apron/vm/NumberFormat.h"
#include "apron/vm/Vm.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

// Printed between the replayed entries and the new one; a private-use character that no program prints.
constexpr std::string_view kMarker = "\xEE\x80\x80";
constexpr std::string_view kFile = "line";
constexpr std::uint32_t kMaxPictureColumns = 64;
constexpr std::uint32_t kMaxNumberColumns = 16;  // wider registers are rendered as pictures
constexpr std::string_view kShades = " .:-=+*#%@";

constexpr std::string_view kHelp =
    "a line of a program    run it\n"
    "an expression          show its value, as println() does\n"
    ":show A                show register A as a picture\n"
    ":names                 list registers and scalars\n"
    ":list                  show the program so far\n"
    ":save FILE             write the program to a file\n"
    ":undo                  undo the last entry\n"
    ":clear                 start an empty program\n"
    ":quit                  quit\n"
    "help, ?, quit and exit work as well\n";

// Suppresses output and file writes until the marker is printed.
class ReplHost final : public LocalHost {
 public:
  ReplHost(const Options& options, const Print& print)
      : LocalHost(options.parameters, common::stop_flag(), {options.cameras, {}}), print_(print) {}

  bool marker_reached() const { return output_enabled_; }
  bool line_open() const { return line_open_; }
  void print(std::string_view text) override {
    if (text == kMarker) {
      output_enabled_ = true;
    } else if (output_enabled_) {
      print_(text);
      if (!text.empty()) line_open_ = text.back() != '\n';
    }
  }
  vm::HostStatus save_array(std::string_view file, vm::ConstPlane from) override {
    return output_enabled_ ? LocalHost::save_array(file, from) : vm::HostStatus::kOk;
  }
  vm::HostStatus save_image(std::string_view file, vm::ConstPlane from) override {
    return output_enabled_ ? LocalHost::save_image(file, from) : vm::HostStatus::kOk;
  }

 private:
  const Print& print_;
  bool output_enabled_ = false, line_open_ = false;
};

// Serves the typed text as kFile and all other files from disk.
class ReplFileReader final : public syntax::FileReader {
 public:
  explicit ReplFileReader(std::string text) : text_(std::move(text)) {}
  std::optional<std::string> read(const std::string& path) override {
    return path == kFile ? std::optional(text_) : disk_.read(path);
  }

 private:
  std::string text_;
  syntax::DiskReader disk_;
};

bool is_blank(const std::string& text) { return text.find_first_not_of(" \t\r\n") == std::string::npos; }

// The command that a line is, also in the spellings that people try first; "" for a line of a program.
std::string command_of(const std::string& line) {
  if (line == "?" || line == "help" || line == "h") return ":help";
  if (line == "quit" || line == "exit" || line == "q") return ":quit";
  return line.starts_with(':') ? line : "";
}

std::string strip(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

enum class EntryKind { kStatement, kExpression, kEither };

// A name or call may be either.
EntryKind kind_of(const std::string& text) {
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  const std::vector<syntax::Line> lines = syntax::lex(sources, sources.add_file("", text, {}), diagnostics);
  if (lines.size() != 1 || !diagnostics.empty()) return EntryKind::kStatement;
  const syntax::Tokens& tokens = lines.front().tokens;
  const syntax::Token& first = tokens.front();
  const bool begins_value = first.kind == syntax::TokenKind::kNumber ||
                            first.kind == syntax::TokenKind::kString ||
                            first.kind == syntax::TokenKind::kPunctuator || first.is_name("not");
  const bool is_name = first.kind == syntax::TokenKind::kName && !syntax::is_keyword(first.text);
  if ((!begins_value && !is_name) || syntax::find_equals(tokens.begin(), tokens.end()) != tokens.end())
    return EntryKind::kStatement;
  int depth = 0;
  const auto close = std::find_if(tokens.begin() + 1, tokens.end(), [&](const syntax::Token& token) {
    depth += token.is("(") ? 1 : token.is(")") ? -1 : 0;
    return depth == 0;
  });
  const bool ends_there = close == tokens.end() || close + 1 == tokens.end();
  if (!is_name || (tokens.size() > 1 && !(tokens[1].is("(") && ends_there))) return EntryKind::kExpression;
  const compiler::Builtin* const builtin = compiler::find_builtin(first.text);
  return builtin != nullptr && !builtin->returns_value() ? EntryKind::kStatement : EntryKind::kEither;
}

// The text up to the comment that ends it.
std::string without_comment(const std::string& text) {
  bool is_quoted = false;
  for (std::size_t i = text.rfind('\n') + 1; i < text.size(); ++i) {
    if (text[i] == '\'') is_quoted = !is_quoted;
    if (!is_quoted && text.compare(i, 2, "//") == 0) return strip(text.substr(0, i));
  }
  return text;
}

}  // namespace

bool is_incomplete(const std::string& text) {
  if (const std::string end = strip(text); !end.empty() && end.back() == '\\') return true;
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  const std::uint32_t file = sources.add_file("", text, {});
  int blocks = 0, conditions = 0, macros = 0;
  for (const syntax::Line& line : syntax::lex(sources, file, diagnostics)) {
    const syntax::Token& first = line.tokens.front();
    const auto is = [&](std::initializer_list<std::string_view> words) {
      return std::ranges::find(words, first.text) != words.end();
    };
    if (first.kind == syntax::TokenKind::kDirective) {
      conditions += is({"if", "for"}) ? 1 : is({"endif", "endfor"}) ? -1 : 0;
      macros += is({"macro_def"}) ? 1 : is({"macro_end"}) ? -1 : 0;
    } else if (first.kind == syntax::TokenKind::kName && line.tokens.size() != 1 && is({"function"})) {
      macros += line.tokens[1].kind == syntax::TokenKind::kName ? 1 : 0;
    } else if (first.kind == syntax::TokenKind::kName && is({"endfunction"})) {
      --macros;
    } else if (first.kind == syntax::TokenKind::kName && macros == 0) {
      blocks += is({"if", "while", "for", "repeat", "where"})                  ? 1
                : is({"endif", "endwhile", "endfor", "endrepeat", "endwhere"}) ? -1
                                                                               : 0;
    }
  }
  return diagnostics.empty() && (blocks > 0 || conditions > 0 || macros > 0);
}

std::string format_register_ascii(const std::vector<float>& cells, std::uint32_t width, std::uint32_t height,
                                  std::uint32_t columns) {
  float low = INFINITY, high = -INFINITY;
  for (const float value : cells) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // Cells per character; twice as many rows as columns, because characters are about twice as high as wide.
  const std::uint32_t step = (width + columns - 1) / columns;
  const std::uint32_t row_step = width > columns ? 2 * step : 1;
  std::string text;
  for (std::uint32_t y = 0; y < height; y += row_step) {
    for (std::uint32_t x = 0; x < width; x += step) {
      float value = -INFINITY;  // maximum of the cells that share the character
      for (std::uint32_t cell_y = y; cell_y < std::min(y + row_step, height); ++cell_y)
        for (std::uint32_t cell_x = x; cell_x < std::min(x + step, width); ++cell_x)
          value = std::max(value, cells[cell_y * width + cell_x]);
      const float fraction = high > low ? (value - low) / (high - low) : value != 0.0F ? 1.0F : 0.0F;
      const auto shade =
          static_cast<std::size_t>(std::clamp(fraction, 0.0F, 1.0F) * (kShades.size() - 1) + 0.5F);
      text += std::isfinite(value) ? kShades[shade] : '?';
    }
    while (!text.empty() && text.back() == ' ') text.pop_back();
    text += '\n';
  }
  return text + std::to_string(width) + "x" + std::to_string(height) + ", " + vm::format_number(low) +
         " to " + vm::format_number(high) + "\n";
}

Repl::Repl(const Options& options, std::istream& in, Print print, bool prompts)
    : options_(options), in_(in), print_(std::move(print)), prompts_(prompts) {
  options_.program = kFile;
}

void Repl::run() {
  std::string pending;
  for (;;) {
    if (prompts_) print_(pending.empty() ? "> " : ". ");
    std::fflush(stdout);
    std::string line;
    if (!std::getline(in_, line)) break;
    if (const std::string command = pending.empty() ? command_of(strip(line)) : ""; !command.empty()) {
      if (!handle_command(command)) return;
      continue;
    }
    pending += line + '\n';
    if (is_incomplete(pending)) continue;
    if (!is_blank(pending)) handle_entry(pending);
    pending.clear();
    if (common::stop_flag()) return;
  }
  if (!is_blank(pending)) handle_entry(pending);
  if (prompts_) print_("\n");
}

// Returns false for :quit.
bool Repl::handle_command(const std::string& line) {
  const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
  const std::string word = line.substr(0, end), rest = strip(line.substr(end));
  if (word == ":quit" || word == ":q") return false;
  if (word == ":help") {
    print_(kHelp);
  } else if (word == ":names") {
    show_names();
  } else if (word == ":list") {
    for (const std::string& entry : accepted_) print_(entry);
  } else if (word == ":clear") {
    accepted_.clear();
    values_.clear();
  } else if (word == ":undo") {
    if (!accepted_.empty()) accepted_.pop_back();
    print_(compile_and_run("").report);
  } else if (word == ":show" || word == ":save") {
    if (rest.empty())
      print_(word + " takes " + (word == ":show" ? "the name of a register" : "a file name") + "\n");
    else if (word == ":show")
      show_value(rest);
    else
      save(rest);
  } else {
    print_("unknown command '" + line + "'; see :help\n");
  }
  return true;
}

void Repl::save(const std::string& file) {
  std::string text;
  for (const std::string& entry : accepted_) text += entry;
  try {
    write_file(file, text);
  } catch (const MediaError& error) {
    print_(std::string(error.what()) + "\n");
  }
}

void Repl::handle_entry(const std::string& text) {
  const std::string word = without_comment(strip(text));
  const auto known = [&](const NamedValue& one) { return one.name == word && one.width > kMaxNumberColumns; };
  if (std::ranges::any_of(values_, known)) return show_value(word);
  const EntryKind kind = kind_of(text);
  Result statement;
  if (kind != EntryKind::kExpression) {
    statement = compile_and_run(text);
    if (statement.outcome == Outcome::kSuccess) {
      accepted_.push_back(text);
      return;
    }
  }
  if (kind == EntryKind::kStatement || statement.outcome == Outcome::kRuntimeError)
    return print_(statement.report);
  static constexpr std::string_view kShow = "println(";
  const Result expression = compile_and_run(std::string(kShow) + word + ")\n");
  // The error that is further on is not about what the entry is taken for.
  const bool is_expression = expression.outcome != Outcome::kCompileError || kind == EntryKind::kExpression ||
                             statement.column + kShow.size() <= expression.column;
  print_((is_expression ? expression : statement).report);
}

Repl::Result Repl::compile_and_run(const std::string& text) {
  std::string source;
  for (const std::string& value : accepted_) source += value;
  const auto first_line = static_cast<std::uint32_t>(std::ranges::count(source, '\n') + 1);
  ReplFileReader reader(source + text);
  const compiler::CompileOptions compiler_options =
      compile_options(options_, options_.width, options_.height);
  compiler::CompileResult result =
      compiler::compile(compiler_options, reader, {first_line, std::string(kMarker)});
  if (!result.program) {
    const syntax::Location& first = result.diagnostics.front().location;
    const bool is_in_line = first.file == 0 && first.line == first_line;
    return {Outcome::kCompileError, syntax::format_diagnostics(result.diagnostics, result.sources),
            is_in_line ? first.column : std::numeric_limits<std::uint32_t>::max()};
  }
  for (const auto& [name, value] : options_.parameters) {
    const auto& all = result.program->parameters;
    if (std::ranges::find(all, name, &program::Parameter::name) == all.end()) continue;  // not yet
    if (const std::string problem = program::parameter_problem(*result.program, name, value);
        !problem.empty())
      return {Outcome::kRuntimeError, "error: --set: " + problem + "\n"};
  }
  ReplHost host(options_, print_);
  if (const std::string error =
          host.load_modules(*result.program, options_.modules, module_search_paths(options_));
      !error.empty())
    return {Outcome::kRuntimeError, error + "\n"};
  vm::VmOptions options;
  options.threads = options_.threads;
  options.isa = options_.isa;
  options.stop = &common::stop_flag();
  vm::Vm vm(std::move(*result.program), options, host);
  vm::Status status = vm.run();
  while (status == vm::Status::kTick) status = vm.run();
  if (host.line_open()) print_("\n");
  if (status != vm::Status::kEnded) {
    if (common::stop_signal() == SIGINT) common::clear_stop_signal();
    return {Outcome::kRuntimeError, status == vm::Status::kInterrupted ? "interrupted\n" : vm.error() + "\n"};
  }
  if (!host.marker_reached())
    return {Outcome::kRuntimeError, "the program ends before this line; :undo removes the last entry\n"};
  values_.clear();
  const program::Program& program = vm.program();
  for (std::size_t i = 0; i < program.registers.size(); ++i) {
    const vm::Plane plane = vm.plane(i);
    NamedValue value{program.registers[i].name, plane.width, plane.height, {}};
    if (program::is_temporary(value.name)) continue;
    for (std::uint32_t y = 0; y < plane.height; ++y)
      for (std::uint32_t x = 0; x < plane.width; ++x) value.cells.push_back(vm::cell_as_float(plane, x, y));
    values_.push_back(std::move(value));
  }
  for (std::size_t i = 0; i < program.variables.size(); ++i) {
    if (!program::is_temporary(program.variables[i].name))
      values_.push_back({program.variables[i].name, 0, 0, {static_cast<float>(vm.variable(i))}});
  }
  return {};
}

void Repl::show_names() {
  for (const NamedValue& value : values_)
    print_(value.name +
           (value.width == 0 ? " = " + vm::format_number(value.cells.front())
                             : " " + std::to_string(value.width) + "x" + std::to_string(value.height)) +
           "\n");
}

void Repl::show_value(const std::string& name) {
  const auto found = std::ranges::find(values_, name, &NamedValue::name);
  if (found == values_.end())
    print_("there is no '" + name + "'; :names lists all names\n");
  else if (found->width == 0)
    print_(vm::format_number(found->cells.front()) + "\n");
  else
    print_(format_register_ascii(found->cells, found->width, found->height, kMaxPictureColumns));
}

int run_repl(const Options& options) {
  common::catch_stop_signals();
  const bool prompts = isatty(STDIN_FILENO) != 0;
  if (prompts)
    common::print_output("apron repl: " + std::to_string(options.width) + "x" +
                         std::to_string(options.height) + " cells, help for help\n");
  Repl(options, std::cin, common::print_output, prompts).run();
  return common::kDone;
}

}  // namespace apron::run
