#include "apron/run/import/KernelTranslation.h"

#include <fmt/format.h>

#include <algorithm>

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

// Words of APRON that a variable of the kernel cannot be called.
const std::set<std::string>& reserved_words() {
  static const std::set<std::string> kWords = {"if",
                                               "else",
                                               "endif",
                                               "while",
                                               "endwhile",
                                               "for",
                                               "endfor",
                                               "repeat",
                                               "endrepeat",
                                               "break",
                                               "continue",
                                               "jump",
                                               "jumpif",
                                               "call",
                                               "callif",
                                               "return",
                                               "end",
                                               "nop",
                                               "where",
                                               "elsewhere",
                                               "endwhere",
                                               "boundary",
                                               "function",
                                               "endfunction",
                                               "load",
                                               "copy",
                                               "add",
                                               "sub",
                                               "mul",
                                               "div",
                                               "mod",
                                               "min",
                                               "max",
                                               "abs",
                                               "neg",
                                               "sign",
                                               "pow",
                                               "clamp",
                                               "mac",
                                               "select",
                                               "lt",
                                               "le",
                                               "gt",
                                               "ge",
                                               "eq",
                                               "ne",
                                               "and",
                                               "or",
                                               "xor",
                                               "nand",
                                               "nor",
                                               "not",
                                               "shift",
                                               "north",
                                               "east",
                                               "south",
                                               "west",
                                               "rotate",
                                               "flood",
                                               "distance",
                                               "print",
                                               "println",
                                               "plugin",
                                               "globalsum",
                                               "globalmean",
                                               "globalmin",
                                               "globalmax",
                                               "globalcount",
                                               "globalany",
                                               "r",
                                               "v",
                                               "alldir",
                                               "on",
                                               "off",
                                               "none",
                                               "SURFACE_WIDTH",
                                               "SURFACE_HEIGHT",
                                               "FRAMES"};
  return kWords;
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

void KernelTranslation::note(std::size_t line, std::string text, Severity severity) {
  notes_.push_back(
      {line, std::move(text), severity, in_kernel_, files_[std::min(peek().file, files_.size() - 1)]});
}

// ---- names

KernelTranslation::Variable* KernelTranslation::find_variable(const std::string& name) {
  for (auto scope = scopes_.rbegin(); scope != scopes_.rend(); ++scope)
    if (const auto found = scope->find(name); found != scope->end()) return &found->second;
  return nullptr;
}

bool KernelTranslation::is_register(const std::string& name) const {
  static const std::set<std::string> kDirections = {"north", "east", "south", "west", "alldir"};
  for (auto scope = scopes_.rbegin(); scope != scopes_.rend(); ++scope)
    if (const auto found = scope->find(name); found != scope->end())
      return found->second.type == CppType::kRegister;
  return vocabulary_.names.contains(name) && !kDirections.contains(name);
}

std::string KernelTranslation::new_name(const std::string& stem) {
  const bool is_taken = vocabulary_.names.contains(stem) || vocabulary_.statements.contains(stem) ||
                        vocabulary_.values.contains(stem) || reserved_words().contains(stem) ||
                        functions_.contains(stem) || stem == "value" || stem == "unused" || stem == "kept";
  std::string name = stem;
  if (is_taken || names_.contains(name)) {
    int& suffix = suffixes_[stem];
    do name = fmt::format("{}_{}", stem, ++suffix);
    while (names_.contains(name));
  }
  names_.insert(name);
  return (in_macro_ ? ":" : "") + name;
}

KernelTranslation::Variable& KernelTranslation::declare(const std::string& name, CppType type) {
  Variable variable;
  variable.type = type;
  variable.range = range_of(type);
  variable.text = name;
  variable.node = flow_.add();
  if (is_scalar(type)) {
    // Names of variables whose scope has ended are used again.
    bool stays = !names_.contains(name);
    for (std::size_t i = 0; i < scopes_.size() && !stays; ++i)
      for (const auto& [other, known] : scopes_[i])
        stays = stays || known.text == name || known.text == ":" + name || known.text == "$" + name;
    if (!stays) {
      names_.erase(name);
      suffixes_.clear();
    }
    variable.text = new_name(name);
  }
  return scopes_.back()[name] = variable;
}

std::optional<CppType> KernelTranslation::read_type(const KernelTokenList& tokens, std::size_t& i,
                                                    bool* is_const) {
  static const std::map<std::string, CppType> kTypes = {
      {"void", CppType::kVoid},       {"bool", CppType::kBool},       {"float", CppType::kFloat},
      {"double", CppType::kFloat},    {"int8_t", CppType::kInt8},     {"uint8_t", CppType::kUint8},
      {"int16_t", CppType::kInt16},   {"uint16_t", CppType::kUint16}, {"int32_t", CppType::kInt},
      {"uint32_t", CppType::kUint},   {"size_t", CppType::kUint},     {"areg_t", CppType::kRegister},
      {"aref_t", CppType::kRegister}, {"dreg_t", CppType::kRegister}, {"dref_t", CppType::kRegister},
      {"AREG", CppType::kRegister},   {"ASRC", CppType::kRegister},   {"DREG", CppType::kRegister},
      {"DSRC", CppType::kRegister},   {"news_t", CppType::kRegister}, {"auto", CppType::kOther},
      {"vs_handle", CppType::kOther}};
  static const std::set<std::string> kQualifiers = {"const",     "static", "volatile",
                                                    "constexpr", "inline", "register"};
  std::optional<CppType> type;
  bool is_unsigned = false;
  int width = 0;
  bool has_word = false;
  std::size_t k = i;
  for (; k < tokens.size() && tokens[k].kind == Kind::kName; ++k) {
    const std::string& word = tokens[k].text;
    if (kQualifiers.contains(word)) {
      if (is_const != nullptr && (word == "const" || word == "constexpr")) *is_const = true;
      continue;
    }
    if (word == "unsigned" || word == "signed") {
      is_unsigned = word == "unsigned";
      has_word = true;
    } else if (word == "int" || word == "long" || word == "short" || word == "char") {
      if (word != "int") width = word == "short" ? 16 : word == "char" ? 8 : width;
      has_word = true;
    } else if (word == "std" && k + 1 < tokens.size() && tokens[k + 1].is("::")) {
      ++k;
    } else if (const auto found = kTypes.find(word); found != kTypes.end() && !type && !has_word) {
      type = found->second;
    } else {
      break;
    }
  }
  if (has_word)
    type = width == 8    ? (is_unsigned ? CppType::kUint8 : CppType::kInt8)
           : width == 16 ? (is_unsigned ? CppType::kUint16 : CppType::kInt16)
                         : (is_unsigned ? CppType::kUint : CppType::kInt);
  if (type) i = k;
  return type;
}

const KernelTranslation::Signature* KernelTranslation::find_function(const std::string& name,
                                                                     std::size_t count) const {
  const auto [first, last] = functions_.equal_range(name);
  for (auto one = first; one != last; ++one)
    if (one->second.accepts(count)) return &one->second;
  return nullptr;
}

// ---- statements that both readers have

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
    if (const Signature* kernel = find_function(plain_text(arguments[0]), 0)) flow_.guard(kernel->call);
    return emit(out, depth, plain_text(arguments[0]));
  }
  if (name.starts_with("vs_gui_add_s") && translate_control(name, arguments)) return;
  if (name == "scamp5_output_image" && !arguments.empty())
    return emit(out, depth, fmt::format("sim.show({})", register_argument(arguments[0])));
  if (name == "DNEWS" && arguments.size() >= 3 && arguments[2].size() > 1)
    return translate_directions(out, depth, arguments);
  call_statement(name, arguments, line, out, depth);
}

void KernelTranslation::note_shared_operands(const std::string& name,
                                             const std::vector<KernelTokenList>& arguments,
                                             std::size_t line) {
  // The operands of the transfer that each instruction ends or begins with.
  const bool reads_target =
      name == "sub" || name == "neg" || name == "divq" || name == "bus" || name == "subx";
  const bool sums = name == "add" || name == "addx" || name == "bus" || name == "bus2";
  if (find_function(name, arguments.size()) != nullptr || (!reads_target && !sums)) return;
  std::set<std::string> seen;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i].size() != 1 || !is_register(arguments[i][0].text)) continue;
    const std::string& text = arguments[i][0].text;
    const bool is_target = i == 0 || (name == "bus2" && i == 1);
    const bool is_first_of_sub = (name == "sub" || name == "subx") && i == 1;
    if (is_target ? reads_target : !is_first_of_sub) {
      if (seen.insert(text).second) continue;
      note(line, fmt::format("the chip connects '{}' once in '{}' and computes something else", text, name),
           Severity::kWarning);
      notes_.back().in_kernel = false;
      return;
    }
  }
}

bool KernelTranslation::translate_control(const std::string& name,
                                          const std::vector<KernelTokenList>& arguments,
                                          const std::string& handle) {
  const bool is_slider = name.starts_with("vs_gui_add_slider");
  const std::size_t count = is_slider ? 4 : 2;  // without the variable
  const bool has_variable =
      arguments.size() == count + 1 && arguments.back().size() == 2 && arguments.back()[0].is("&");
  if (!has_variable && (handle.empty() || arguments.size() != count)) return false;
  const std::string& variable = has_variable ? arguments.back()[1].text : handle;
  std::string values;
  for (std::size_t i = 1; i < count; ++i) {
    const auto constant = constants_.find(plain_text(arguments[i]));
    if (constant != constants_.end()) {
      values += ", " + constant->second;
      continue;
    }
    // Variables are numbers here: those that they have so far.
    KernelTokenList words = arguments[i];
    for (KernelToken& word : words)
      if (const auto known = constants_.find(word.text);
          known != constants_.end() && known->second.find_first_not_of("0123456789.") == std::string::npos)
        word = scan_kernel_source(known->second, word.line, word.file)[0];
    const bool is_known = std::ranges::all_of(words, [&](const KernelToken& word) {
      return word.kind != Kind::kName || word.is_name_of({"true", "false"}) ||
             (find_variable(word.text) != nullptr && find_variable(word.text)->constant);
    });
    const auto value = is_known && words[0].kind != Kind::kString ? plain_expression(words) : std::nullopt;
    if (!value || !value->constant) return false;
    values += fmt::format(", {}", *value->constant);
  }
  const std::string_view kind = is_slider ? "slider" : "switch";
  const std::string reading = fmt::format("sim.{}.get('{}')", kind, variable);
  controls_.push_back(fmt::format("sim.{}.add('{}'{})", kind, variable, values));
  if (!handle.empty()) handles_[handle] = reading;
  if (!has_variable) return true;
  if (find_variable(variable) == nullptr)
    scopes_[0][variable] = {variable, CppType::kInt, range_of(CppType::kInt), {}, false};
  main_.push_back(fmt::format("{} = {}", find_variable(variable)->text, reading));
  return true;
}

bool KernelTranslation::add_control(const std::string& handle, const KernelTokenList& expression) {
  const bool is_control = expression.size() > 2 && expression[0].text.starts_with("vs_gui_add_s") &&
                          expression[1].is("(") && run::behind_bracket(expression, 1) == expression.size();
  return is_control &&
         translate_control(expression[0].text, split_arguments(expression, 2, expression.size() - 1), handle);
}

std::optional<CppValue> KernelTranslation::control_value(const std::string& handle) {
  if (handle == "VS_GUI_FRAME_GAIN" && !handles_.contains(handle)) {
    controls_.emplace_back("sim.slider.add('frame_gain', 1, 5, 1)");
    handles_[handle] = "sim.slider.get('frame_gain')";
  }
  const auto found = handles_.find(handle);
  if (found == handles_.end()) return std::nullopt;
  CppValue value;
  value.text = found->second;
  value.type = CppType::kInt;
  value.range = range_of(CppType::kInt);
  return value;
}

void KernelTranslation::translate_directions(ProgramLines& out, int depth,
                                             const std::vector<KernelTokenList>& arguments) {
  static const std::map<std::string, std::string> kSelectors = {
      {"south", "RS"}, {"west", "RW"}, {"north", "RN"}, {"east", "RE"}};
  std::string selected;
  for (const KernelToken& token : arguments[2]) {
    if (token.is("|") || token.is("(") || token.is(")")) continue;
    const auto selector = kSelectors.find(token.text);
    if (selector == kSelectors.end()) give_up("'{}' is no direction", plain_text(arguments[2]));
    selected += (selected.empty() ? "" : ", ") + selector->second;
  }
  bool edge = false;
  if (arguments.size() > 3) {
    const CppValue value = cpp_condition(expression(arguments[3], out, depth));
    if (!value.constant)
      give_up("the edge of DNEWS, '{}', is known at run time only", plain_text(arguments[3]));
    edge = *value.constant != 0.0;
  }
  const std::string target = register_argument(arguments[0]), source = register_argument(arguments[1]);
  flow_.instruction(place_);
  emit(out, depth, "CLR(RS, RW, RN, RE)");
  emit(out, depth, fmt::format("SET({})", selected));
  emit(out, depth, fmt::format("DNEWS{}({}, {})", edge ? 1 : 0, target, source));
  instructions_ += 3;
}

ImportedKernels KernelTranslation::finish() {
  for (const ValueFlow::Finding& one : flow_.findings())
    notes_.push_back({.line = one.place.line,
                      .text = one.reason + " reaches an instruction or decides about it",
                      .severity = Severity::kError,
                      .file = one.place.file});
  ProgramLines all;
  const auto append = [&](const ProgramLines& lines) { all.insert(all.end(), lines.begin(), lines.end()); };
  append(defines_);
  append(controls_);
  append(unset_lines_);
  append(statics_);
  all.emplace_back("");
  append(macros_);
  if (!options_.picture.empty() && !uses_frames_)
    all.push_back(fmt::format("PIX = io.image.open('{}')", options_.picture));
  append(main_);
  if (!has_main_) {  // the kernels in the order of the text
    for (const auto& [name, arity] : uncalled_)
      if (arity == 0 && !called_.contains(name)) all.push_back(name);
  }
  const bool uses_arithmetic = std::ranges::any_of(
      all, [](const std::string& line) { return line.find("cpp.") != std::string::npos; });
  std::string text =
      fmt::format("// Imported from {} by apron import.\n!include('scamp5.aps')\n{}{}", options_.source_name,
                  uses_arithmetic ? "!include('cpp.aps')\n" : "", uses_frames_ ? "!define(FRAMES, 1)\n" : "");
  for (const std::string& line : all) text += line + '\n';
  return {std::move(text), std::move(notes_), instructions_};
}

void KernelTranslation::emit(ProgramLines& out, int depth, const std::string& text) {
  out.push_back(std::string(depth * 2, ' ') + text);
}

}  // namespace apron::run
