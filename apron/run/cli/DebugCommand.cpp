// `apron debug`: a debugger that reads commands from standard input, for terminals and scripts.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

#include "apron/debugger/DebugSession.h"
#include "apron/debugger/Listing.h"
#include "apron/program/Program.h"
#include "apron/run/cli/Commands.h"
#include "apron/run/cli/TerminalImage.h"
#include "apron/run/media/SavedRegisters.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/run/ui/ConditionCompiler.h"
#include "apron/vm/NumberFormat.h"
#include "common/error/UserError.h"
#include "common/process/StopSignals.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

using debugger::Breakpoint;
using debugger::ExecutionState;
using debugger::StepUnit;

constexpr std::string_view kHelp =
    "break LINE | FILE:LINE | tick N | if CONDITION   stop there; b\n"
    "break change VALUE   stop where a value changes, or a cell: NAME COLUMN ROW\n"
    "breakpoints          list them; delete N removes one, delete all of them\n"
    "continue             run to the next breakpoint or the end; c, run\n"
    "step                 the next line, also inside macros and routines; s\n"
    "next                 the next line of this routine, macro or file, past those that it uses; n\n"
    "stepi                the next instruction\n"
    "tick                 to the end of the tick\n"
    "where                the next line, and the macros that it is in; w\n"
    "list                 the lines around it; l\n"
    "print NAME           a scalar; print NAME COLUMN ROW a cell of a register; p\n"
    "plane NAME           all cells of a register; plane NAME COLUMN ROW WIDTH HEIGHT some of them\n"
    "picture NAME         a register as a picture of characters\n"
    "save NAME FILE       a register as .npy, .csv or picture file\n"
    "names                the registers and scalars\n"
    "restart              start again, with the same breakpoints\n"
    "quit                 q\n"
    "An empty line repeats the last command on a terminal.\n";

class Debugger {
 public:
  Debugger(const Options& options, CompiledProgram compiled, LocalHost& host)
      : options_(options),
        compiled_(std::move(compiled)),
        session_(compiled_.program, vm_options(options), host),
        step_groups_(groups([](const program::SourceLocation* at) { return at; })) {}

  // The exit status: kUserError if a command was refused, kFailed if the program has failed.
  int run(std::istream& in, bool prompts) {
    stop_ = say_where();
    std::string line, last;
    while (!quits_) {
      if (prompts) say("(apron) ");
      std::fflush(stdout);
      if (!std::getline(in, line)) break;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (prompts && line.empty()) line = last;
      last = line;
      execute(line);
    }
    return has_failed_ ? common::kFailed : was_refused_ ? common::kUserError : common::kDone;
  }

 private:
  using Words = std::vector<std::string>;

  static vm::VmOptions vm_options(const Options& options) {
    vm::VmOptions result;
    result.threads = options.threads;
    result.isa = options.isa;
    result.stop = &common::interrupt_flag();
    return result;
  }
  const program::Program& program() const { return compiled_.program; }
  static void say(const std::string& text) { common::print_output(text); }
  void refuse(const std::string& text) {
    was_refused_ = true;
    say("error: " + text + "\n");
  }

  using Expansions = std::set<std::uint32_t>;  // of macros and functions; 0 is the program

  // The macro or function of the location, and those around it.
  Expansions around(const program::SourceLocation* at) const {
    Expansions all{0};
    for (; at != nullptr && at->expansion != 0; at = &program().expansions[at->expansion].call_site)
      all.insert(at->expansion);
    return all;
  }
  // The line of one of them that leads to the location.
  const program::SourceLocation* line_in(const Expansions& outer, const program::SourceLocation* at) const {
    while (at != nullptr && !outer.contains(at->expansion))
      at = &program().expansions[at->expansion].call_site;
    return at;
  }

  // The instructions of each line, in which lines of macros count as `line_of` says.
  template <class LineOf>
  debugger::InstructionGroups groups(const LineOf& line_of) const {
    std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>, std::uint32_t> lines;
    debugger::InstructionGroups result;
    for (std::size_t i = 0; i < program().code.size(); ++i) {
      const program::SourceLocation* at = line_of(program::find_location(program(), i));
      result.push_back(at == nullptr ? 0
                                     : lines
                                           .try_emplace({at->file, at->line, at->expansion},
                                                        static_cast<std::uint32_t>(lines.size() + 1))
                                           .first->second);
    }
    return result;
  }

  void execute(const std::string& line) {
    std::istringstream stream(line);
    Words words;
    for (std::string word; stream >> word;) words.push_back(word);
    if (words.empty() || words[0].front() == '#') return;
    struct Command {
      std::string_view name, short_name;
      void (Debugger::*run)(const Words&);
      std::size_t min_words, max_words;
    };
    static constexpr std::size_t kAny = 64;
    static const Command kCommands[] = {
        {"break", "b", &Debugger::add_breakpoint, 2, kAny},
        {"breakpoints", "", &Debugger::list_breakpoints, 1, 1},
        {"delete", "", &Debugger::delete_breakpoints, 1, 2},
        {"continue", "c", &Debugger::proceed, 1, 1},
        {"run", "", &Debugger::proceed, 1, 1},
        {"step", "s", &Debugger::step, 1, 1},
        {"next", "n", &Debugger::next, 1, 1},
        {"stepi", "", &Debugger::step_instruction, 1, 1},
        {"tick", "", &Debugger::step_tick, 1, 1},
        {"where", "w", &Debugger::where, 1, 1},
        {"list", "l", &Debugger::list, 1, 1},
        {"print", "p", &Debugger::print, 2, 4},
        {"plane", "", &Debugger::print_plane, 2, 6},
        {"picture", "", &Debugger::draw, 2, 2},
        {"save", "", &Debugger::save, 3, 3},
        {"names", "", &Debugger::list_names, 1, 1},
        {"restart", "", &Debugger::restart, 1, 1},
        {"help", "h", &Debugger::help, 1, 1},
        {"quit", "q", &Debugger::quit, 1, 1},
    };
    const auto* const command = std::ranges::find_if(kCommands, [&](const Command& c) {
      return words[0] == c.name || (!c.short_name.empty() && words[0] == c.short_name);
    });
    if (command == std::end(kCommands))
      return refuse("there is no command '" + words[0] + "': help lists them");
    if (words.size() < command->min_words || words.size() > command->max_words)
      return refuse("'" + line + "': " + words[0] + " takes other arguments: help lists them");
    (this->*command->run)(words);
  }

  // ---- where the program is ----

  std::string place(const program::SourceLocation& at) const {
    return program().files[at.file] + ":" + std::to_string(at.line);
  }
  std::vector<std::string> source_lines(const program::SourceLocation& at) const {
    const auto source =
        std::ranges::find(compiled_.sources, program().files[at.file], &debugger::SourceText::name);
    if (source == compiled_.sources.end()) return {};
    return debugger::split_lines(source->text);
  }
  std::string source_line(const program::SourceLocation& at) const {
    const std::vector<std::string> lines = source_lines(at);
    return at.line > 0 && at.line <= lines.size() ? lines[at.line - 1] : "";
  }
  // outer: those whose lines are told; all if there are none. Returns what was told.
  const program::SourceLocation* say_where(const Expansions& outer = {}) {
    if (session_.state() == ExecutionState::kFinished) {
      if (!session_.vm().error().empty()) {
        has_failed_ = true;
        say(session_.vm().error() + "\n");
      } else {
        say("the program has ended\n");
      }
      return nullptr;
    }
    const program::SourceLocation* at = program::find_location(program(), session_.vm().program_counter());
    if (at == nullptr || at->line == 0) {
      say("at the end of the program\n");
      return nullptr;
    }
    if (!outer.empty()) at = line_in(outer, at);
    say(place(*at) + ": " + source_line(*at) + "\n");
    return at;
  }
  void where(const Words&) {
    say_where();
    const program::SourceLocation* at = program::find_location(program(), session_.vm().program_counter());
    while (at != nullptr && at->expansion != 0 && session_.state() != ExecutionState::kFinished) {
      const program::Expansion& expansion = program().expansions[at->expansion];
      at = &expansion.call_site;
      say("  in " + expansion.macro + ", used at " + place(*at) + "\n");
    }
    if (session_.vm().call_depth() > 0)
      say("  in a routine, " + std::to_string(session_.vm().call_depth()) + " calls deep\n");
  }
  void list(const Words&) {
    const program::SourceLocation* const at =
        program::find_location(program(), session_.vm().program_counter());
    if (at == nullptr || at->line == 0) return say("at the end of the program\n");
    constexpr std::uint32_t kLines = 4;
    const std::vector<std::string> lines = source_lines(*at);
    for (std::uint32_t number = 1; number <= lines.size() && number <= at->line + kLines; ++number)
      if (number + kLines >= at->line)
        say((number == at->line ? "> " : "  ") + std::to_string(number) + "  " + lines[number - 1] + "\n");
  }

  // ---- execution ----

  void advance() {
    while (session_.active()) {
      session_.advance();
      if (!common::interrupt_flag()) continue;
      common::clear_stop_signal();
      session_.pause();
      say("interrupted\n");
    }
  }
  void report_stop(const Expansions& outer = {}) {
    debugger::DebugSnapshot snapshot;
    session_.capture_snapshot({}, snapshot);
    const bool is_hit = snapshot.hit && session_.state() != ExecutionState::kFinished;
    if (is_hit) say("breakpoint " + std::to_string(numbers_[*snapshot.hit]) + "\n");
    stop_ = say_where(is_hit ? Expansions{} : outer);
  }
  bool refuses_to_go_on() {
    if (session_.state() != ExecutionState::kFinished) return false;
    refuse("the program has ended: restart");
    return true;
  }
  void proceed(const Words&) {
    if (refuses_to_go_on()) return;
    session_.run();
    advance();
    report_stop();
  }
  void go(StepUnit unit, const debugger::InstructionGroups& groups) {
    if (refuses_to_go_on()) return;
    session_.step(unit, groups);
    advance();
    report_stop();
  }
  void step(const Words&) { go(StepUnit::kLine, step_groups_); }
  void step_instruction(const Words&) { go(StepUnit::kInstruction, {}); }
  void step_tick(const Words&) { go(StepUnit::kTick, {}); }
  void next(const Words&) {
    if (refuses_to_go_on()) return;
    const std::size_t depth = session_.vm().call_depth();
    const Expansions outer = around(stop_);
    const debugger::InstructionGroups lines =
        groups([&](const program::SourceLocation* at) { return line_in(outer, at); });
    debugger::DebugSnapshot snapshot;
    do {
      session_.step(StepUnit::kLine, lines);
      advance();
      session_.capture_snapshot({}, snapshot);
    } while (session_.state() != ExecutionState::kFinished && !snapshot.hit &&
             session_.vm().call_depth() > depth);
    report_stop(outer);
  }
  void restart(const Words&) {
    session_.reset();
    stop_ = say_where();
  }
  void quit(const Words&) { quits_ = true; }
  void help(const Words&) { say(std::string(kHelp)); }

  // ---- breakpoints ----

  void add_breakpoint(const Words& words) {
    Breakpoint breakpoint;
    std::uint64_t number = 0;
    std::vector<program::Program> conditions = conditions_;
    if ((words[1] == "if" || words[1] == "change") && words.size() > 2) {
      breakpoint.kind = Breakpoint::Kind::kCondition;
      breakpoint.on_change = words[1] == "change";
      if (std::uint64_t column = 0; breakpoint.on_change && words.size() == 5 &&
                                    common::parse_number(words[3], column) &&
                                    common::parse_number(words[4], number))
        breakpoint.condition = debugger::cell_expression(words[2], column, number);
      else
        for (std::size_t i = 2; i < words.size(); ++i) breakpoint.condition += (i > 2 ? " " : "") + words[i];
      std::string error;
      auto condition =
          compile_condition(breakpoint.condition, program(), options_.width, options_.height, error);
      if (!condition) return refuse("'" + breakpoint.condition + "': " + error);
      conditions.push_back(std::move(*condition));
    } else if (words[1] == "tick" && words.size() == 3) {
      breakpoint.kind = Breakpoint::Kind::kTick;
      if (!common::parse_number(words[2], breakpoint.tick) || breakpoint.tick == 0)
        return refuse("'" + words[2] + "' is not the number of a tick, from 1");
    } else if (words.size() == 2) {
      const std::size_t colon = words[1].rfind(':');
      const std::string file =
          colon == std::string::npos ? program().files.front() : words[1].substr(0, colon);
      const std::string line = colon == std::string::npos ? words[1] : words[1].substr(colon + 1);
      const auto found = std::ranges::find_if(program().files, [&](const std::string& name) {
        return name == file || name.ends_with("/" + file);
      });
      if (found == program().files.end()) return refuse("the program has no file '" + file + "'");
      if (!common::parse_number(line, number) || number == 0 || number > UINT32_MAX)
        return refuse("'" + line + "' is not a line number");
      breakpoint.file = *found;
      breakpoint.line = first_line_with_code(*found, static_cast<std::uint32_t>(number));
      if (breakpoint.line == 0) return refuse("no line from " + line + " on has instructions");
    } else {
      return refuse("break takes LINE, FILE:LINE, tick N, if CONDITION or change VALUE");
    }
    breakpoints_.push_back(breakpoint);
    numbers_.push_back(++last_number_);
    conditions_ = std::move(conditions);
    session_.set_breakpoints(breakpoints_, conditions_);
    say("breakpoint " + std::to_string(last_number_) + ": " + describe(breakpoint) + "\n");
  }
  // 0 if there is none.
  std::uint32_t first_line_with_code(const std::string& file, std::uint32_t line) const {
    const auto source = std::ranges::find(compiled_.sources, file, &debugger::SourceText::name);
    const auto last = source == compiled_.sources.end() ? 0 : std::ranges::count(source->text, '\n') + 1;
    for (; line <= last; ++line)
      if (!debugger::instructions_of_line(program(), file, line).empty()) return line;
    return 0;
  }
  static std::string describe(const Breakpoint& breakpoint) {
    switch (breakpoint.kind) {
      case Breakpoint::Kind::kTick:
        return "tick " + std::to_string(breakpoint.tick);
      case Breakpoint::Kind::kCondition:
        return (breakpoint.on_change ? "change " : "if ") + breakpoint.condition;
      case Breakpoint::Kind::kLine:
        break;
    }
    return breakpoint.file + ":" + std::to_string(breakpoint.line);
  }
  void list_breakpoints(const Words&) {
    for (std::size_t i = 0; i < breakpoints_.size(); ++i)
      say(std::to_string(numbers_[i]) + "  " + describe(breakpoints_[i]) + "\n");
  }
  void delete_breakpoints(const Words& words) {
    std::uint64_t number = 0;
    if (words.size() == 1) {
      breakpoints_.clear();
      numbers_.clear();
      conditions_.clear();
    } else if (!common::parse_number(words[1], number) || std::ranges::count(numbers_, number) == 0) {
      return refuse("there is no breakpoint '" + words[1] + "'");
    } else {
      const auto numbered = std::ranges::find(numbers_, number);
      const auto at = breakpoints_.begin() + (numbered - numbers_.begin());
      const auto earlier = std::count_if(breakpoints_.begin(), at, [](const Breakpoint& b) {
        return b.kind == Breakpoint::Kind::kCondition;
      });
      if (at->kind == Breakpoint::Kind::kCondition) conditions_.erase(conditions_.begin() + earlier);
      breakpoints_.erase(at);
      numbers_.erase(numbered);
    }
    session_.set_breakpoints(breakpoints_, conditions_);
  }

  // ---- values ----

  // The local name of the macro or function in which the program is.
  const program::LocalName* find_local(const std::string& name) const {
    if (session_.state() == ExecutionState::kFinished) return nullptr;
    return program::find_local(program(), name, session_.vm().program_counter());
  }
  double scalar(const program::Operand& operand) const {
    return operand.kind == program::OperandKind::kLiteral ? program().literals[operand.index]
                                                          : session_.vm().variable(operand.index);
  }
  // The element of that number, or an operand of no kind.
  static program::Operand find_element(const program::LocalName& local, double number) {
    const bool exists =
        number >= 0.0 && number < static_cast<double>(local.elements.size()) && number == std::trunc(number);
    return exists ? local.elements[static_cast<std::size_t>(number)] : program::Operand{};
  }
  program::Operand operand_of(const program::LocalName& local) const {
    const bool is_element = !local.elements.empty() && local.operand.kind != program::OperandKind::kNone;
    return is_element ? find_element(local, scalar(local.operand)) : local.operand;
  }
  // The register, variable or literal of a name, local ones first; an operand of no kind if there is none.
  program::Operand locate(const std::string& name) const {
    using program::OperandKind;
    if (const program::LocalName* const local = find_local(name)) return operand_of(*local);
    std::uint32_t number = 0;
    if (const std::size_t open = name.find('['); open != std::string::npos && name.back() == ']')
      if (const program::LocalName* const local = find_local(name.substr(0, open)))
        return common::parse_number(name.substr(open + 1, name.size() - open - 2), number) &&
                       local->operand.kind == OperandKind::kNone
                   ? find_element(*local, number)
                   : program::Operand{};
    const auto variable = std::ranges::find(program().variables, name, &program::Variable::name);
    if (variable != program().variables.end())
      return {OperandKind::kVariable, static_cast<std::uint32_t>(variable - program().variables.begin())};
    if (const std::optional<std::size_t> reg = program::find_register(program(), name))
      return {OperandKind::kRegister, static_cast<std::uint32_t>(*reg)};
    return {};
  }
  // Why no register is located by that name.
  std::string no_register(const std::string& name) const {
    const program::LocalName* const local = find_local(name);
    if (local == nullptr || operand_of(*local).kind != program::OperandKind::kNone)
      return "the program has no register " + program::unknown_register(program(), name);
    if (local->operand.kind != program::OperandKind::kNone)
      return "'" + name + "' is an element of an array of " + std::to_string(local->elements.size()) +
             ", and there is no number " + vm::format_number(scalar(local->operand));
    if (!local->elements.empty()) return "'" + name + "' is an array: " + name + "[0] is its first element";
    if (local->text.empty()) return "'" + name + "' has no value yet";
    return "'" + name + "' is " + local->text + " here, which no register or scalar holds";
  }
  std::optional<std::size_t> find_plane(const std::string& name) {
    const program::Operand found = locate(name);
    if (found.kind == program::OperandKind::kRegister) return found.index;
    const bool is_program_scalar =
        found.kind == program::OperandKind::kVariable && find_local(name) == nullptr;
    const auto reg = is_program_scalar ? program::find_register(program(), name) : std::nullopt;
    if (!reg) refuse(no_register(name));
    return reg;
  }
  bool parse_numbers(const Words& words, std::size_t first, std::vector<std::uint64_t>& numbers) {
    for (std::size_t i = first; i < words.size(); ++i)
      if (!common::parse_number(words[i], numbers.emplace_back())) {
        refuse("'" + words[i] + "' is not a whole number from 0");
        return false;
      }
    return true;
  }

  void print(const Words& words) {
    const program::Operand found = locate(words[1]);
    const bool is_scalar =
        found.kind == program::OperandKind::kVariable || found.kind == program::OperandKind::kLiteral;
    if (is_scalar && words.size() == 2)
      return say(words[1] + " = " + vm::format_number(scalar(found)) + "\n");
    std::vector<std::uint64_t> at;
    if (const program::LocalName* const local = find_local(words[1]);
        local != nullptr && found.kind == program::OperandKind::kNone && words.size() == 4) {
      const bool is_column = local->text == "cell.x" || local->text == "cell.col";
      if (is_column || local->text == "cell.y" || local->text == "cell.row") {
        if (parse_numbers(words, 2, at))
          say(words[1] + "(" + words[2] + ", " + words[3] + ") = " + words[is_column ? 2 : 3] + "\n");
        return;
      }
    }
    const std::optional<std::size_t> reg = find_plane(words[1]);
    if (!reg) return;
    const vm::Plane plane = session_.vm().plane(*reg);
    if (words.size() == 2)
      return say(words[1] + " is a register of " + vm::format_shape(plane) +
                 ": print NAME COLUMN ROW, plane or picture show its cells\n");
    if (words.size() != 4) return refuse("print takes NAME, or NAME COLUMN ROW");
    if (!parse_numbers(words, 2, at)) return;
    if (at[0] >= plane.width || at[1] >= plane.height)
      return refuse("column " + words[2] + ", row " + words[3] + " is outside a register of " +
                    vm::format_shape(plane));
    say(words[1] + "(" + words[2] + ", " + words[3] + ") = " + format_cell(plane, at[0], at[1]) + "\n");
  }
  static std::string format_cell(const vm::Plane& plane, std::uint64_t x, std::uint64_t y) {
    const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
    return program::is_integer(plane.type) ? vm::format_number(vm::cell_value(plane, column, row))
                                           : vm::format_number(plane.row(row)[column]);
  }
  void print_plane(const Words& words) {
    const std::optional<std::size_t> reg = find_plane(words[1]);
    std::vector<std::uint64_t> part;
    if (!reg || !parse_numbers(words, 2, part)) return;
    const vm::Plane plane = session_.vm().plane(*reg);
    if (part.empty()) part = {0, 0, plane.width, plane.height};
    if (part.size() != 4) return refuse("plane takes NAME, or NAME COLUMN ROW WIDTH HEIGHT");
    if (part[0] >= plane.width || part[1] >= plane.height)
      return refuse("column " + words[2] + ", row " + words[3] + " is outside a register of " +
                    vm::format_shape(plane));
    const std::uint64_t east =
        std::min<std::uint64_t>(part[0] + std::min<std::uint64_t>(part[2], plane.width), plane.width);
    const std::uint64_t south =
        std::min<std::uint64_t>(part[1] + std::min<std::uint64_t>(part[3], plane.height), plane.height);
    for (std::uint64_t y = part[1]; y < south; ++y) {
      std::string row;
      for (std::uint64_t x = part[0]; x < east; ++x)
        row += (row.empty() ? "" : " ") + format_cell(plane, x, y);
      say(row + "\n");
    }
  }
  void draw(const Words& words) {
    if (const std::optional<std::size_t> reg = find_plane(words[1]))
      say(render_ascii(session_.vm().plane(*reg), {}));
  }
  void save(const Words& words) {
    const std::optional<std::size_t> reg = find_plane(words[1]);
    if (!reg) return;
    const std::vector<SavedRegister> saved{{program().registers[*reg].name, words[2]}};
    try {
      check_saved(saved, program());
    } catch (const common::UserError& error) {
      std::string text = error.what();
      return refuse(text.starts_with("--save: ") ? text.substr(8) : text);
    }
    const std::string error = save_registers(saved, session_.vm());
    if (!error.empty()) refuse(error.starts_with("--save: ") ? error.substr(8) : error);
  }
  void list_names(const Words&) {
    const std::size_t at = session_.vm().program_counter();
    for (const program::LocalName& local : program().local_names) {
      if (at < local.first || at >= local.last || find_local(local.name) != &local) continue;
      const program::Operand operand = operand_of(local);
      if (operand.kind == program::OperandKind::kRegister)
        say(local.name + " " + vm::format_shape(session_.vm().plane(operand.index)) + "\n");
      else if (operand.kind != program::OperandKind::kNone)
        say(local.name + " = " + vm::format_number(scalar(operand)) + "\n");
    }
    for (const program::Register& r : program().registers)
      if (!program::is_temporary(r.name))
        say(r.name + " " + std::to_string(r.width) + "x" + std::to_string(r.height) + "\n");
    for (std::size_t i = 0; i < program().variables.size(); ++i)
      if (const std::string& name = program().variables[i].name; !program::is_temporary(name))
        say(name + " = " + vm::format_number(std::as_const(session_).vm().variable(i)) + "\n");
  }

  const Options& options_;
  CompiledProgram compiled_;
  debugger::DebugSession session_;
  debugger::InstructionGroups step_groups_;
  const program::SourceLocation* stop_ = nullptr;  // the line told at the last stop, if there is one
  std::vector<Breakpoint> breakpoints_;
  std::vector<std::uint64_t> numbers_;  // of the breakpoints, never given again
  std::uint64_t last_number_ = 0;
  std::vector<program::Program> conditions_;
  bool quits_ = false, was_refused_ = false, has_failed_ = false;
};

}  // namespace

int debug_program(const Options& options) {
  common::catch_stop_signals();
  CompilerMessages messages;
  std::optional<CompiledProgram> compiled =
      compile_with_sources(options, options.width, options.height, messages);
  common::print_message(messages.text);
  if (!compiled) return common::kUserError;
  check_parameters(options, compiled->program);
  LocalHost host(options.parameters, common::interrupt_flag(), host_environment(options));
  if (const std::string error =
          host.load_modules(compiled->program, options.modules, module_search_paths(options));
      !error.empty())
    throw common::UserError(error);
  return Debugger(options, std::move(*compiled), host).run(std::cin, isatty(STDIN_FILENO) != 0);
}

}  // namespace apron::run
