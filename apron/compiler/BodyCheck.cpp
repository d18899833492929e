#include "apron/compiler/BodyCheck.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/compiler/MacroBody.h"
#include "apron/syntax/Parser.h"
#include "apron/syntax/Preprocessor.h"

namespace apron::compiler {
namespace {

using syntax::Location;
using syntax::Macro;

// The arguments that a macro may take for a parameter whose kind it does not state.
constexpr std::string_view kRegister = "apron.trial", kNumber = "1", kText = "'text'", kOperator = "<",
                           kLabel = "#apron.trial", kRegisters = "apron.trial.planes",
                           kNumbers = "apron.trial.numbers";
// Registers of the other types of cells.
constexpr std::array<std::string_view, 3> kIntegers{"apron.trial.int32", "apron.trial.uint16",
                                                    "apron.trial.uint8"};
constexpr std::array kArguments = {kRegister,
                                   kNumber,
                                   kText,
                                   kOperator,
                                   kLabel,
                                   std::string_view("VARIABLE"),
                                   std::string_view("REGISTER"),
                                   kRegisters,
                                   kNumbers,
                                   kIntegers[0],
                                   kIntegers[1],
                                   kIntegers[2]};
constexpr std::string_view kTargets[] = {kRegister, "apron.trial.number", kIntegers[0], kIntegers[1],
                                         kIntegers[2]};

// Serves the program with lines appended to its main file.
class AppendingReader final : public syntax::FileReader {
 public:
  AppendingReader(syntax::FileReader& reader, const std::string& path, const std::string& lines)
      : reader_(reader), path_(path) {
    const std::string text = reader_.read(path_).value_or("") + "\n\n";
    first_line_ = static_cast<std::uint32_t>(std::ranges::count(text, '\n') + 1);
    text_ = text + lines;
  }
  std::optional<std::string> read(const std::string& path) override {
    return path == path_ ? text_ : reader_.read(path);
  }
  std::uint32_t first_line() const { return first_line_; }  // of those appended

 private:
  syntax::FileReader& reader_;
  std::string path_, text_;
  std::uint32_t first_line_ = 0;
};

// The kind of operand that a parameter is: the one that its macro states, or a macro to which the body passes
// it.
class OperandKinds {
 public:
  explicit OperandKinds(const syntax::MacroTable& macros) : macros_(macros) {}

  // Empty: unknown. Found once for each macro, parameter and depth: bodies that call each other repeatedly
  // have any number of paths.
  std::string of(const Macro& macro, std::size_t parameter, int depth = 0) {
    constexpr int kMaxDepth = 8;
    const std::string& stated = macro.parameters[parameter].kind;
    if (!stated.empty() || depth == kMaxDepth) return stated;
    const std::tuple key(&macro, parameter, depth);
    if (const auto known = known_.find(key); known != known_.end()) return known->second;
    return known_[key] = kind_in_body(macro, parameter, depth);
  }

 private:
  std::string kind_in_body(const Macro& macro, std::size_t parameter, int depth) {
    for (const syntax::Line& line : macro.body) {
      const syntax::Tokens& tokens = line.tokens;
      const auto open =
          std::ranges::find_if(tokens, [](const syntax::Token& token) { return token.is("("); });
      if (open == tokens.begin() || open == tokens.end() || !tokens.back().is(")")) continue;
      const std::vector<syntax::Tokens> arguments = syntax::split_arguments(open + 1, tokens.end() - 1);
      const auto callee = macros_.find(open[-1].text, arguments.size(), open - tokens.begin() > 1);
      for (std::size_t i = 0; callee != nullptr && i < arguments.size(); ++i) {
        const bool passes = arguments[i].size() == 1 &&
                            arguments[i].front().kind == syntax::TokenKind::kParameter &&
                            arguments[i].front().text == macro.parameters[parameter].name;
        const std::string kind = passes ? of(*callee, i, depth + 1) : "";
        if (!kind.empty()) return kind;
      }
    }
    return {};
  }

  const syntax::MacroTable& macros_;
  std::map<std::tuple<const Macro*, std::size_t, int>, std::string> known_;
};

std::string_view argument_of_type(const syntax::MacroParameter& parameter) {
  using syntax::ArgumentType;
  if (parameter.is_array) return parameter.type == ArgumentType::kNumber ? kNumbers : kRegisters;
  switch (parameter.type) {
    case ArgumentType::kPlane:
    case ArgumentType::kRegister:
      return kRegister;
    case ArgumentType::kNumber:
    case ArgumentType::kInteger:
      return kNumber;
    case ArgumentType::kText:
      return kText;
    case ArgumentType::kAny:
      return {};
  }
  return {};
}

// An error is reported only if every call with a single kind of argument has it, and no call that mixes two
// or three kinds is free of errors on that line.
struct Calls {
  std::vector<std::string> all;
  std::size_t uniform = 0;  // the first ones
};

Calls calls_of(const Macro& macro, const syntax::Preprocessor& preprocessor, OperandKinds& kinds) {
  constexpr std::size_t kMaxLists = 200;
  std::vector<std::vector<std::string_view>> lists;
  const std::size_t count = macro.parameters.size();
  std::vector<std::string> stated;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view typed = argument_of_type(macro.parameters[i]);
    if (!typed.empty()) {
      stated.emplace_back(typed);
      continue;
    }
    stated.push_back(preprocessor.operand_of_kind(kinds.of(macro, i), i));
  }
  const bool has_free =
      std::ranges::any_of(stated, [](const std::string& operand) { return operand.empty(); });
  const auto base = [&](std::string_view kind) { return std::vector<std::string_view>(count, kind); };
  if (!has_free) {
    lists.push_back(base(kRegister));
    for (const std::string_view kind : kIntegers) lists.push_back(base(kind));
  }
  for (const std::string_view kind : kArguments) lists.push_back(base(kind));
  for (std::size_t i = 0; i < count && lists.size() < kMaxLists; ++i) {
    for (const std::string_view most : {kRegister, kNumber})
      for (const std::string_view other : kArguments) (lists.emplace_back(base(most)))[i] = other;
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count && lists.size() < kMaxLists; ++j) {
      if (i == j) continue;
      for (const auto& [most, one, another] :
           {std::array{kRegister, kText, kNumber}, {kNumber, kText, kText}, {kNumber, kOperator, kLabel}}) {
        std::vector<std::string_view>& list = lists.emplace_back(base(most));
        list[i] = one;
        list[j] = another;
      }
    }
  }
  // A plane may be of any type.
  const bool has_plane = std::ranges::find(stated, kRegister) != stated.end();
  lists.resize(has_free ? std::min(lists.size(), kMaxLists) : has_plane ? 1 + kIntegers.size() : 1);
  Calls result;
  for (const std::vector<std::string_view>& list : lists) {
    std::string call = macro.name;
    for (std::size_t i = 0; i < count; ++i)
      call += fmt::format("{}{}", i == 0 ? "(" : ", ",
                          stated[i].empty() || (!has_free && stated[i] == kRegister) ? list[i] : stated[i]);
    if (count > 0) call += ')';
    if (macro.result_parameter.empty()) {
      result.all.push_back(std::move(call));
    } else {
      for (const std::string_view target : kTargets) {
        std::string targets(target);
        for (std::size_t i = 0; i < macro.further_results.size(); ++i) targets += fmt::format(", {}", target);
        result.all.push_back(fmt::format("{} = {}", targets, call));
      }
    }
    if (&list == &lists[has_free && lists.size() > 1 ? 1 : 0]) result.uniform = result.all.size();
  }
  return result;
}

bool has_define(const Macro& macro) {
  return std::ranges::any_of(macro.body, [](const syntax::Line& line) {
    return line.tokens.front().kind == syntax::TokenKind::kDirective && line.tokens.front().text == "define";
  });
}

// Only a real call determines the meaning of a name that is made of an argument.
bool joins_arguments(const Macro& macro) {
  return std::ranges::any_of(macro.body, [](const syntax::Line& line) {
    const syntax::Tokens& tokens = line.tokens;
    for (std::size_t i = 1; i + 1 < tokens.size(); ++i)
      if (tokens[i].is("##") && (tokens[i - 1].kind == syntax::TokenKind::kParameter ||
                                 tokens[i + 1].kind == syntax::TokenKind::kParameter))
        return true;
    return false;
  });
}

using ErrorKey = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::string>;

using Errors = std::map<ErrorKey, syntax::Diagnostic>;

struct Trial {
  std::string name;
  Location definition;
  bool defines = false;
  Calls calls;
  std::optional<Errors> errors;  // those of all calls so far

  std::span<const std::string> calls_from(std::size_t first, std::size_t count) const {
    const std::span all(calls.all);
    return all.subspan(first, std::min(count, all.size() - first));
  }
  bool is_free_of_errors() const { return errors && errors->empty(); }

  // Forgets the errors that a call did not have: if it is mixed, it has others in the same lines.
  void keep(const Errors& found, bool is_uniform) {
    const auto has_line = [&](const ErrorKey& error) {
      const auto next = found.lower_bound({std::get<0>(error), std::get<1>(error), 0, ""});
      return next != found.end() && std::get<0>(next->first) == std::get<0>(error) &&
             std::get<1>(next->first) == std::get<1>(error);
    };
    if (!errors && is_uniform) {
      errors = found;
    } else if (errors) {
      std::erase_if(*errors, [&](const auto& entry) {
        return is_uniform ? !found.contains(entry.first) : !has_line(entry.first);
      });
    }
  }
};

// One compilation of the program with a call of each macro.
class Round {
 public:
  Round(const CompileOptions& options, syntax::FileReader& reader, const std::string& calls)
      : reader_(reader, options.file,
                fmt::format(
                    "!register({}, {}[99])\n!scalar({}, {}[99])\n!int32({})\n!uint16({})\n!uint8({})\n{}\n{}",
                    kRegister, kRegisters, kTargets[1], kNumbers, kIntegers[0], kIntegers[1], kIntegers[2],
                    kLabel, calls)),
        preprocessor_(preprocessing(options), reader_, sources_, diagnostics_),
        statements_(syntax::Parser(preprocessor_, sources_, diagnostics_).parse()) {
    Lowering(  // the whole program
        {options.width, options.height}, sources_, diagnostics_, preprocessor_)
        .lower_program(statements_);
    for (syntax::Diagnostic& error : diagnostics_.take()) {
      const Location& at = error.location;
      const std::uint32_t call = call_number(at);
      if (call == kNone) continue;
      if (is_appended(at) || error.is_conditional)
        refused_.insert(call);
      else
        errors_[call].emplace(ErrorKey{at.file, at.line, at.column, error.message}, std::move(error));
    }
    drop_open_blocks();
  }

  const syntax::Preprocessor& preprocessor() const { return preprocessor_; }
  syntax::SourceManager& sources() { return sources_; }
  // The errors in the body of the call of that number, from 0.
  Errors& errors(std::uint32_t call) { return errors_[call]; }
  // An error is in the arguments: they are not what the body takes.
  bool is_refused(std::uint32_t call) const { return refused_.contains(call); }

 private:
  static constexpr std::uint32_t kNone = UINT32_MAX;
  static constexpr std::uint32_t kLinesBefore = 6;

  bool is_appended(const Location& at) const {
    return at.file == 0 && at.line >= reader_.first_line() + kLinesBefore;
  }

  // The call that leads to the location.
  std::uint32_t call_number(Location at) const {
    while (at.expansion != 0) at = sources_.expansion(at.expansion).call;
    return is_appended(at) ? at.line - reader_.first_line() - kLinesBefore : kNone;
  }

  // A body that opens or closes another macro's blocks cannot be checked alone.
  void drop_open_blocks() {
    for (std::size_t i = 0; i < statements_.size(); ++i) {
      const syntax::Statement& begin = statements_[i];
      if (begin.kind != syntax::StatementKind::kMacroBegin || begin.location.expansion != 0) continue;
      std::size_t end = i + 1;
      while (end < statements_.size() && statements_[end].expansion_id != begin.expansion_id) ++end;
      const std::span<const syntax::Statement> all(statements_);
      if (!scan_macro_body(all.subspan(i + 1, end - i - 1)).closes_its_blocks)
        errors_.erase(call_number(begin.location));
    }
  }

  syntax::SourceManager sources_;
  syntax::Diagnostics diagnostics_{SIZE_MAX};
  AppendingReader reader_;
  syntax::Preprocessor preprocessor_;
  std::vector<syntax::Statement> statements_;
  std::map<std::uint32_t, Errors> errors_;
  std::set<std::uint32_t> refused_;
};

}  // namespace

CompileResult check_macro_bodies(const CompileOptions& options, syntax::FileReader& reader) {
  const auto is_installed = [&](const Location& at, const syntax::SourceManager& sources) {
    return at.file != 0 && !options.library_path.empty() &&
           sources.file(at.file).name.starts_with(options.library_path + '/');
  };
  CompileResult result;
  std::map<ErrorKey, syntax::Diagnostic> found;  // in the order of their locations
  std::vector<Trial> trials;
  Round program(options, reader, "");
  OperandKinds kinds(program.preprocessor().macros());
  for (const syntax::MacroTable::Handle& macro : program.preprocessor().macros().all())
    if (!is_installed(macro->location, program.sources()) && !joins_arguments(*macro))
      trials.push_back({macro->name,
                        macro->location,
                        has_define(*macro),
                        calls_of(*macro, program.preprocessor(), kinds),
                        {}});
  // Definitions of a body hold for the calls after it.
  std::ranges::stable_partition(trials, [](const Trial& trial) { return !trial.defines; });
  // Most macros need one call. The many calls of the others share compilations, each of the whole program.
  const std::size_t calls_at_once = std::max<std::size_t>(trials.size(), 256);
  for (std::size_t first = 0, count = 1; !trials.empty(); first += count) {
    count = first == 0 || trials.back().defines ? 1 : std::max<std::size_t>(1, calls_at_once / trials.size());
    std::string calls;
    for (const Trial& trial : trials)
      for (const std::string& call : trial.calls_from(first, count)) calls += call + '\n';
    Round tried(options, reader, calls);
    std::vector<Trial> remaining;
    std::uint32_t number = 0;
    for (Trial& trial : trials) {
      const std::size_t end = first + trial.calls_from(first, count).size();
      for (std::size_t call = first; call < end; ++call, ++number)
        if (!trial.is_free_of_errors() && !tried.is_refused(number))
          trial.keep(tried.errors(number), call < trial.calls.uniform);
      if (trial.is_free_of_errors()) continue;
      if (end < trial.calls.all.size()) {
        remaining.push_back(std::move(trial));
      } else if (trial.errors) {
        for (auto& [key, error] : *trial.errors) {
          error.location.expansion = 0;
          error.notes = {
              {trial.definition,
               fmt::format("every call of the macro '{}' has this error; it is defined", trial.name)}};
          found.emplace(key, std::move(error));
        }
      }
    }
    trials = std::move(remaining);
  }
  for (auto& [key, error] : found) {
    if (result.diagnostics.size() == syntax::kMaxErrors) break;
    result.diagnostics.push_back(std::move(error));
  }
  result.sources = std::move(program.sources());
  return result;
}

}  // namespace apron::compiler
