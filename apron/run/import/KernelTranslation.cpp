#include "apron/run/import/KernelTranslation.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/text/Suggestion.h"

namespace apron::run {

using Kind = KernelTokenKind;

bool is_number(const KernelTokenList& tokens) {
  return tokens.size() == 1 ? tokens[0].kind == Kind::kNumber
                            : tokens.size() == 2 && tokens[0].is("-") && tokens[1].kind == Kind::kNumber;
}

std::string plain_text(const KernelTokenList& tokens) {
  std::string text;
  for (const KernelToken& token : tokens) text += token.text;
  return text;
}

namespace {

// The arguments between two positions, which commas outside brackets separate. Leaves comments out.
std::vector<KernelTokenList> split_arguments(const KernelTokenList& tokens, std::size_t first,
                                             std::size_t last) {
  std::vector<KernelTokenList> arguments(1);
  int depth = 0;
  for (std::size_t i = first; i < last; ++i) {
    const KernelToken& token = tokens[i];
    if (token.kind == Kind::kComment) continue;
    if (token.opens_bracket()) ++depth;
    if (token.closes_bracket()) --depth;
    if (depth == 0 && token.is(","))
      arguments.emplace_back();
    else
      arguments.back().push_back(token);
  }
  if (arguments.size() == 1 && arguments[0].empty()) arguments.clear();
  return arguments;
}

std::string counts(const std::set<std::size_t>& arities) {
  std::string text;
  for (const std::size_t arity : arities) text += (text.empty() ? "" : " or ") + std::to_string(arity);
  return text;
}

}  // namespace

const KernelToken& KernelTranslation::peek(std::size_t offset) const {
  return tokens_[std::min(position_ + offset, tokens_.size() - 1)];
}

bool KernelTranslation::at_end() const { return peek().kind == Kind::kEnd; }

bool KernelTranslation::consume(std::string_view symbol) {
  if (!peek().is(symbol)) return false;
  ++position_;
  return true;
}

std::size_t KernelTranslation::behind_bracket(std::size_t open) const {
  int depth = 0;
  for (std::size_t i = open; i < tokens_.size(); ++i) {
    const KernelToken& token = tokens_[i];
    if (token.opens_bracket()) ++depth;
    if (token.closes_bracket() && --depth == 0) return i + 1;
  }
  return tokens_.size() - 1;
}

KernelTokenList KernelTranslation::tokens_between(std::size_t first, std::size_t last) const {
  KernelTokenList out;
  for (std::size_t i = first; i < last; ++i)
    if (tokens_[i].kind != Kind::kComment) out.push_back(tokens_[i]);
  return out;
}

std::vector<KernelTokenList> KernelTranslation::parse_arguments() {  // at the '('
  const std::size_t first = position_ + 1;
  position_ = behind_bracket(position_);
  return split_arguments(tokens_, first, position_ - 1);
}

void KernelTranslation::note(std::size_t line, std::string text) {
  notes_.push_back({line, std::move(text), in_kernel_});
}

std::string KernelTranslation::operand(const KernelToken& token, std::size_t line) {
  if (token.text == "true") return "1";
  if (token.text == "false") return "0";
  if (parameters_.contains(token.text)) return "$" + token.text;
  if (arrays_.contains(token.text)) give_up("the array '{}' belongs to the controller", token.text);
  const bool is_known = vocabulary_.names.contains(token.text) || known_names_.contains(token.text);
  if (!is_known && unset_.insert(token.text).second) {
    note(line == 0 ? token.line : line, fmt::format("'{}' has no value in the kernels; it is 0", token.text));
    unset_lines_.push_back(fmt::format("{} = 0  // of the program around the kernels", token.text));
  }
  return token.text;
}

std::string KernelTranslation::expression(const KernelTokenList& tokens, std::size_t line) {
  std::string text;
  bool after_value = false;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    const KernelToken& token = tokens[i];
    if (token.kind == Kind::kName && i + 1 < tokens.size() && tokens[i + 1].is("::")) {
      ++i;
      continue;
    }
    if (token.kind == Kind::kName && i + 1 < tokens.size() && tokens[i + 1].is("(")) {
      text += nested_call(tokens, i);
      after_value = true;
      continue;
    }
    if (token.kind == Kind::kNumber || token.kind == Kind::kName) {
      text += token.kind == Kind::kName ? operand(token, line) : token.text;
      after_value = true;
      continue;
    }
    static const std::set<std::string> kInfix = {"+",  "-",  "*",  "/",  "%",  "<", ">",
                                                 "<=", ">=", "==", "!=", "&&", "||"};
    const bool bracket = token.is("(") || token.is(")");
    if (token.kind != Kind::kPunctuator || (!bracket && !token.is("!") && !kInfix.contains(token.text)))
      give_up("'{}' in an expression has no counterpart", token.text);
    const bool infix = kInfix.contains(token.text) && after_value;
    text += infix ? " " + token.text + " " : token.text;
    after_value = token.is(")");
  }
  if (text.empty()) give_up("a value is missing");
  return text;
}

std::string KernelTranslation::nested_call(const KernelTokenList& tokens, std::size_t& i) {
  const std::string name = tokens[i].text;
  int depth = 0;
  std::size_t end = i + 1;
  for (; end < tokens.size(); ++end) {
    if (tokens[end].is("(")) ++depth;
    if (tokens[end].is(")") && --depth == 0) break;
  }
  const std::vector<KernelTokenList> arguments = split_arguments(tokens, i + 2, end);
  const std::size_t line = tokens[i].line;
  i = end;
  return call_text(name, arguments, line, true);
}

std::string KernelTranslation::call_text(const std::string& name,
                                         const std::vector<KernelTokenList>& arguments, std::size_t line,
                                         bool value) {
  const auto& table = value ? vocabulary_.values : vocabulary_.statements;
  const auto found = table.find(name);
  const auto function = functions_.find(name);
  const bool is_function =
      !value && function != functions_.end() && function->second.contains(arguments.size());
  if (found == table.end() && !is_function) {
    std::vector<std::string> known;
    for (const auto& [mnemonic, arities] : table) known.push_back(mnemonic);
    if (in_kernel_) give_up("scamp5.aps has no instruction '{}'{}", name, common::did_you_mean(name, known));
    give_up("'{}' runs on the controller or host", name);
  }
  if (!is_function && !found->second.contains(arguments.size()))
    give_up("'{}' takes {} arguments, not {}", name, counts(found->second), arguments.size());
  std::string text;
  const auto append = [&](const KernelTokenList& argument) {
    text += (text.empty() ? "(" : ", ") + expression(argument, line);
  };
  for (const KernelTokenList& argument : arguments) append(argument);
  if (const auto defaults = defaults_.find(name); is_function && defaults != defaults_.end()) {
    const std::size_t given = arguments.size() + defaults->second.size() - *function->second.rbegin();
    for (std::size_t i = given; i < defaults->second.size(); ++i) append(defaults->second[i]);
  }
  if (is_function) called_.insert(name);
  if (!is_function) ++instructions_;
  return name + text + (text.empty() ? "" : ")");
}

void KernelTranslation::emit_comment(ProgramLines& out, int depth) {
  const std::string& text = peek().text;
  if (text.find_first_not_of("-/=*") != std::string::npos) emit(out, depth, "// " + text);
  ++position_;
}

void KernelTranslation::translate_call(ProgramLines& out, int depth) {
  const std::string name = peek().text;
  const std::size_t line = peek().line;
  ++position_;
  const std::vector<KernelTokenList> arguments = parse_arguments();
  if (peek().kind == Kind::kPunctuator && !peek().is(";") && !peek().is("}") && !peek().is(")"))
    give_up("the expression that begins with '{}(…)' has no counterpart", name);
  consume(";");
  if (name == "scamp5_kernel_begin" || name == "scamp5_kernel_end") {
    in_kernel_ = name == "scamp5_kernel_begin";
    return;
  }
  if (name == "scamp5_launch_kernel" && arguments.size() == 1) {
    called_.insert(plain_text(arguments[0]));
    return emit(out, depth, plain_text(arguments[0]));
  }
  if (name.starts_with("vs_gui_add_s") && translate_control(name, arguments)) return;
  if (name == "scamp5_output_image" && !arguments.empty())
    return emit(out, depth, fmt::format("sim.show({})", expression(arguments[0])));
  if (name == "DNEWS" && arguments.size() >= 3 && arguments[2].size() > 1)
    return translate_directions(out, depth, arguments);
  emit(out, depth, call_text(name, arguments, line, false));
}

bool KernelTranslation::translate_control(const std::string& name,
                                          const std::vector<KernelTokenList>& arguments) {
  const bool is_slider = name == "vs_gui_add_slider";
  const std::size_t count = is_slider ? 5 : 3;
  if (arguments.size() != count || arguments.back().size() != 2 || !arguments.back()[0].is("&")) return false;
  const std::string& variable = arguments.back()[1].text;
  std::string values;
  for (std::size_t i = 1; i + 1 < count; ++i) {
    const auto constant = constants_.find(plain_text(arguments[i]));
    if (is_slider && !is_number(arguments[i]) && constant == constants_.end()) return false;
    values += ", " + (is_number(arguments[i]) ? plain_text(arguments[i])
                      : is_slider             ? constant->second
                                              : "0");
  }
  controls_.push_back(fmt::format("sim.{}.add('{}'{})", is_slider ? "slider" : "switch", variable, values));
  main_.push_back(fmt::format("{0} = sim.{1}.get('{0}')", variable, is_slider ? "slider" : "switch"));
  known_names_.insert(variable);
  return true;
}

void KernelTranslation::translate_directions(ProgramLines& out, int depth,
                                             const std::vector<KernelTokenList>& arguments) {
  static const std::map<std::string, std::string> kSelectors = {
      {"south", "RS"}, {"west", "RW"}, {"north", "RN"}, {"east", "RE"}};
  std::string selected;
  for (const KernelToken& token : arguments[2]) {
    if (token.is("|")) continue;
    const auto selector = kSelectors.find(token.text);
    if (selector == kSelectors.end()) give_up("'{}' is no direction", plain_text(arguments[2]));
    selected += (selected.empty() ? "" : ", ") + selector->second;
  }
  const bool edge =
      arguments.size() > 3 && plain_text(arguments[3]) != "0" && plain_text(arguments[3]) != "false";
  emit(out, depth, "CLR(RS, RW, RN, RE)");
  emit(out, depth, fmt::format("SET({})", selected));
  emit(out, depth,
       fmt::format("DNEWS{}({}, {})", edge ? 1 : 0, expression(arguments[0]), expression(arguments[1])));
  instructions_ += 3;
}

ImportedKernels KernelTranslation::finish() {
  std::string text =
      fmt::format("// Imported from {} by apron import.\n!include('scamp5.aps')\n", options_.source_name);
  if (uses_frames_) text += "!define(FRAMES, 1)\n";
  const auto append = [&](const ProgramLines& lines) {
    for (const std::string& line : lines) text += line + '\n';
  };
  append(defines_);
  append(controls_);
  append(unset_lines_);
  text += '\n';
  append(macros_);
  if (!options_.picture.empty() && !uses_frames_)
    text += fmt::format("PIX = io.image.open('{}')\n", options_.picture);
  append(main_);
  if (!has_main_) {  // the kernels in the order of the text
    for (const auto& [name, arity] : uncalled_)
      if (arity == 0 && !called_.contains(name)) text += name + '\n';
  }
  return {std::move(text), std::move(notes_), instructions_};
}

void KernelTranslation::emit(ProgramLines& out, int depth, const std::string& text) {
  out.push_back(std::string(static_cast<std::size_t>(depth) * 2, ' ') + text);
}

}  // namespace apron::run
