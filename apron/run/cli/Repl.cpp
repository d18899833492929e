#include "apron/run/cli/Repl.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>
#include <sstream>
#include <string_view>

#include "apron/compiler/Compiler.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/syntax/Lexer.h"
#include "apron/vm/NumberFormat.h"
#include "apron/vm/Vm.h"
#include "common/process/StopSignals.h"

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
    "an expression          show its value\n"
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
  ReplHost(const Options& options, std::ostream& out)
      : LocalHost(options.parameters, common::stop_flag(), {options.cameras, {}}), out_(out) {}

  bool marker_reached() const { return output_enabled_; }
  bool line_open() const { return line_open_; }
  void print(std::string_view text) override {
    if (text == kMarker) {
      output_enabled_ = true;
    } else if (output_enabled_) {
      out_ << text;
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
  std::ostream& out_;
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

Repl::Repl(const Options& options, std::istream& in, std::ostream& out, bool prompts)
    : options_(options), in_(in), out_(out), prompts_(prompts) {
  options_.program = kFile;
}

void Repl::run() {
  std::string pending;
  for (;;) {
    if (prompts_) out_ << (pending.empty() ? "> " : ". ") << std::flush;
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
  if (prompts_) out_ << '\n';
}

// Returns false for :quit.
bool Repl::handle_command(const std::string& line) {
  std::istringstream words(line);
  std::string word, rest;
  words >> word >> rest;
  std::string report;
  if (word == ":quit" || word == ":q") return false;
  if (word == ":help") {
    out_ << kHelp;
  } else if (word == ":names") {
    show_names();
  } else if (word == ":list") {
    for (const std::string& entry : accepted_) out_ << entry;
  } else if (word == ":clear") {
    accepted_.clear();
    values_.clear();
  } else if (word == ":undo") {
    if (!accepted_.empty()) accepted_.pop_back();
    if (!replay(report)) out_ << report;
  } else if (word == ":show" && !rest.empty()) {
    show_value(rest);
  } else if (word == ":save" && !rest.empty()) {
    std::string text;
    for (const std::string& entry : accepted_) text += entry;
    try {
      write_file(rest, text);
    } catch (const MediaError& error) {
      out_ << error.what() << '\n';
    }
  } else {
    out_ << "unknown command '" << line << "'; see :help\n";
  }
  return true;
}

bool Repl::replay(std::string& report) { return compile_and_run("", report) == Outcome::kSuccess; }

void Repl::handle_entry(const std::string& text) {
  std::string report, expression_report;
  const std::string word = strip(text);
  const auto known = [&](const NamedValue& one) { return one.name == word && one.width > kMaxNumberColumns; };
  if (std::ranges::any_of(values_, known)) return show_value(word);
  Outcome outcome = compile_and_run(text, report);
  if (outcome == Outcome::kSuccess) {
    accepted_.push_back(text);
    return;
  }
  // An expression is not a statement: retry it as the argument of println().
  const bool one_line = std::ranges::count(text, '\n') == 1;
  if (outcome == Outcome::kCompileError && one_line && word.find("//") == std::string::npos) {
    outcome = compile_and_run("println(" + word + ")\n", expression_report);
    if (outcome == Outcome::kSuccess) return;
    if (outcome == Outcome::kRuntimeError) report = expression_report;
  }
  out_ << report;
}

Repl::Outcome Repl::compile_and_run(const std::string& text, std::string& report) {
  std::string source;
  for (const std::string& value : accepted_) source += value;
  source += "print('" + std::string(kMarker) + "')\n" + text;
  ReplFileReader reader(source);
  const compiler::CompileOptions compiler_options =
      compile_options(options_, options_.width, options_.height);
  compiler::CompileResult result = compiler::compile(compiler_options, reader);
  if (!result.program) {
    report = syntax::format_diagnostics(result.diagnostics, result.sources);
    return Outcome::kCompileError;
  }
  for (const auto& [name, value] : options_.parameters) {
    const auto& all = result.program->parameters;
    if (std::ranges::find(all, name, &program::Parameter::name) == all.end()) continue;  // not yet
    if (const std::string problem = program::parameter_problem(*result.program, name, value);
        !problem.empty()) {
      report = "error: --set: " + problem + "\n";
      return Outcome::kRuntimeError;
    }
  }
  ReplHost host(options_, out_);
  if (const std::string error =
          host.load_modules(*result.program, options_.modules, module_search_paths(options_));
      !error.empty()) {
    report = error + "\n";
    return Outcome::kRuntimeError;
  }
  vm::VmOptions options;
  options.threads = options_.threads;
  options.isa = options_.isa;
  options.stop = &common::stop_flag();
  vm::Vm vm(std::move(*result.program), options, host);
  vm::Status status = vm.run();
  while (status == vm::Status::kTick) status = vm.run();
  if (host.line_open()) out_ << '\n';
  if (status != vm::Status::kEnded) {
    report = status == vm::Status::kInterrupted ? "interrupted\n" : vm.error() + "\n";
    if (common::stop_signal() == SIGINT) common::clear_stop_signal();
    return Outcome::kRuntimeError;
  }
  if (!host.marker_reached()) {
    report = "the program ends before this line; :undo removes the last entry\n";
    return Outcome::kRuntimeError;
  }
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
  return Outcome::kSuccess;
}

void Repl::show_names() {
  for (const NamedValue& value : values_) {
    out_ << value.name;
    if (value.width == 0) {
      out_ << " = " << vm::format_number(value.cells.front()) << '\n';
    } else {
      out_ << ' ' << value.width << 'x' << value.height << '\n';
    }
  }
}

void Repl::show_value(const std::string& name) {
  const auto found = std::ranges::find(values_, name, &NamedValue::name);
  if (found == values_.end()) {
    out_ << "there is no '" << name << "'; :names lists all names\n";
  } else if (found->width == 0) {
    out_ << vm::format_number(found->cells.front()) << '\n';
  } else {
    out_ << format_register_ascii(found->cells, found->width, found->height, kMaxPictureColumns);
  }
}

int run_repl(const Options& options) {
  common::catch_stop_signals();
  const bool prompts = isatty(STDIN_FILENO) != 0;
  if (prompts)
    std::cout << "apron repl: " << options.width << "x" << options.height << " cells, help for help\n";
  Repl(options, std::cin, std::cout, prompts).run();
  return common::kDone;
}

}  // namespace apron::run
