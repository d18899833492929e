// Expressions of C++: parsed with their types, and written in APRON with the statements that they need first.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "apron/run/import/KernelTranslation.h"
#include "common/text/Suggestion.h"

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

const KernelToken kNoToken;

bool is_plain(const std::string& text) { return text.find("cpp.") == std::string::npos; }

CppValue value_of(const std::string& text, CppType type, CppRange range) {
  CppValue value;
  value.text = text;
  value.type = type;
  value.range = range;
  return value;
}

// The integer types of parameters of the chip's interface that are narrower than int.
std::optional<CppType> interface_type(const std::string& function, std::size_t index) {
  if ((function == "scamp5_in" || function == "scamp5_load_in") && index <= 1) return CppType::kInt8;
  static const std::set<std::string> kBytes = {
      "scamp5_load_pattern",      "scamp5_load_point", "scamp5_load_rect", "scamp5_select_pattern",
      "scamp5_select_point",      "scamp5_draw_pixel", "scamp5_draw_rect", "scamp5_global_or",
      "scamp5_global_sum_sparse", "scamp5_read_areg"};
  if (kBytes.contains(function)) return CppType::kUint8;
  return std::nullopt;
}

CppValue number_value(const KernelToken& token) {
  const CppType type = token.number == KernelNumber::kFloat       ? CppType::kFloat
                       : token.number == KernelNumber::kUnsigned  ? CppType::kUint
                       : token.number == KernelNumber::kCharacter ? CppType::kInt8
                                                                  : CppType::kInt;
  const double written = std::strtod(token.text.c_str(), nullptr);
  const double value = type == CppType::kFloat ? static_cast<float>(written) : written;
  if (!std::isfinite(value)) give_up("'{}' does not fit float", token.spelling);
  if (type != CppType::kFloat && value > range_of(type).high)
    give_up("'{}' does not fit {}", token.spelling, type == CppType::kUint ? "unsigned" : "int");
  CppValue number = cpp_constant(value, type);
  // APRON reads a fraction as the same float, and whole numbers exactly.
  if (value == written || value != std::trunc(value)) number.text = token.text;
  return number;
}

}  // namespace

struct KernelTranslation::Cursor {
  const KernelTokenList& tokens;
  std::size_t i = 0;
  const KernelToken& peek(std::size_t offset = 0) const {
    return i + offset < tokens.size() ? tokens[i + offset] : kNoToken;
  }
  bool consume(std::string_view symbol) {
    if (!peek().is(symbol)) return false;
    ++i;
    return true;
  }
};

template <class Action>
void KernelTranslation::with_prelude(ProgramLines& out, int depth, const Action& action) {
  ProgramLines* const outer = std::exchange(prelude_, &out);
  const int outer_depth = std::exchange(prelude_depth_, depth);
  const auto restore = [&] {
    prelude_ = outer;
    prelude_depth_ = outer_depth;
  };
  try {
    action();
  } catch (...) {
    restore();
    throw;
  }
  restore();
}

CppValue KernelTranslation::expression(const KernelTokenList& tokens, ProgramLines& out, int depth) {
  CppValue value;
  with_prelude(out, depth, [&] {
    Cursor cursor{tokens};
    if (tokens.empty()) give_up("a value is missing");
    value = parse_assignment(cursor);
    while (cursor.consume(",")) value = parse_assignment(cursor);
    if (cursor.i < tokens.size()) give_up("'{}' in an expression has no counterpart", cursor.peek().text);
  });
  return value;
}

std::optional<CppValue> KernelTranslation::plain_expression(const KernelTokenList& tokens) {
  ProgramLines lines;
  const std::set<std::string> names = names_;
  const std::size_t instructions = instructions_;
  const CppValue value = expression(tokens, lines, 0);
  if (lines.empty() && !value.is_call && is_plain(value.text)) return value;
  names_ = names;
  suffixes_.clear();
  instructions_ = instructions;
  return std::nullopt;
}

CppValue KernelTranslation::store_new(CppValue value) {
  const std::string name = new_name("value");
  emit(*prelude_, prelude_depth_, fmt::format("{} = {}", name, value.text));
  value.text = name;
  value.binding = Binding::kPrimary;
  value.is_call = false;
  return value;
}

CppValue KernelTranslation::settle(CppValue value) {
  return value.is_call ? store_new(std::move(value)) : value;
}

CppValue KernelTranslation::settle(CppValue value, ProgramLines& out, int depth) {
  with_prelude(out, depth, [&] { value = settle(std::move(value)); });
  return value;
}

template <class Parse>
ProgramLines KernelTranslation::separate(const Parse& parse) {
  ProgramLines lines;
  const ValueFlow::Node condition = flow_.add();
  flow_.write(condition);
  const ValueFlow::Guard guard(flow_, condition);
  with_prelude(lines, prelude_depth_ + 1, parse);
  return lines;
}

CppValue KernelTranslation::parse_assignment(Cursor& cursor) {
  const bool is_target = cursor.peek().kind == Kind::kName && is_assignment(cursor.peek(1));
  if (!is_target) return parse_conditional(cursor);
  const Nesting nesting(depth_, "the expression");
  const std::string name = cursor.peek().text, op = cursor.peek(1).text;
  cursor.i += 2;
  CppValue value = parse_assignment(cursor);
  Variable* variable = find_variable(name);
  if (variable == nullptr || !is_scalar(variable->type))
    give_up("'{} {} …' is code of the controller", name, op);
  if (variable->is_const) give_up("'{}' is const", name);
  const std::string text = variable->text;
  const CppType type = variable->type;
  if (op != "=") {
    value = settle(std::move(value));
    const auto result =
        cpp_binary(value_of(text, type, variable->range), op.substr(0, op.size() - 1), std::move(value));
    if (!result) give_up("'{}' in an expression has no counterpart", op);
    value = *result;
  }
  value =
      cpp_convert(value.is_call && value.type != type ? settle(std::move(value)) : std::move(value), type);
  if (!is_scalar(value.type)) give_up("'{} {} …' is code of the controller", name, op);
  variable->range = range_of(type);
  flow_.write(variable->node);
  emit(*prelude_, prelude_depth_, fmt::format("{} = {}", text, value.text));
  return value_of(text, type, range_of(type));
}

CppValue KernelTranslation::parse_conditional(Cursor& cursor) {
  const Nesting nesting(depth_, "the expression");
  CppValue test = parse_binary(cursor, 0);
  if (!cursor.consume("?")) return test;
  test = cpp_condition(settle(std::move(test)));
  CppValue yes, no;
  const ProgramLines before_yes = separate([&] { yes = settle(parse_assignment(cursor)); });
  if (!cursor.consume(":")) give_up("'?' without ':'");
  const ProgramLines before_no = separate([&] { no = settle(parse_assignment(cursor)); });
  if (!is_scalar(yes.type) || !is_scalar(no.type)) {
    if (test.constant) return *test.constant != 0.0 ? yes : no;
    give_up("which register '? :' chooses is known at run time only");
  }
  const CppType type = cpp_common_type(yes.type, no.type);
  yes = cpp_convert(std::move(yes), yes.type == no.type ? yes.type : type);
  no = cpp_convert(std::move(no), yes.type);
  const CppRange range{std::min(yes.range.low, no.range.low), std::max(yes.range.high, no.range.high)};
  if (before_yes.empty() && before_no.empty()) {
    if (test.constant) return *test.constant != 0.0 ? yes : no;
    return value_of(fmt::format("select({}, {}, {})", test.text, yes.text, no.text), yes.type, range);
  }
  const std::string name = new_name("value");
  const auto branch = [&](const ProgramLines& lines, const std::string& text) {
    prelude_->insert(prelude_->end(), lines.begin(), lines.end());
    emit(*prelude_, prelude_depth_ + 1, fmt::format("{} = {}", name, text));
  };
  emit(*prelude_, prelude_depth_, fmt::format("if({})", test.text));
  branch(before_yes, yes.text);
  emit(*prelude_, prelude_depth_, "else");
  branch(before_no, no.text);
  emit(*prelude_, prelude_depth_, "endif");
  return value_of(name, yes.type, range);
}

CppValue KernelTranslation::parse_binary(Cursor& cursor, int least) {
  CppValue left = parse_unary(cursor);
  for (;;) {
    const auto [op, level] = binary_operator(cursor.peek());
    if (level < least) return left;
    ++cursor.i;
    left = settle(std::move(left));
    if (level <= 1) {
      left = parse_logical(cursor, std::move(left), op, level);
      continue;
    }
    CppValue right = settle(parse_binary(cursor, level + 1));
    auto result = cpp_binary(std::move(left), op, std::move(right));
    if (!result) give_up("'{}' in an expression has no counterpart", op);
    left = std::move(*result);
  }
}

// The right side of && and || is evaluated only if the left one does not decide.
CppValue KernelTranslation::parse_logical(Cursor& cursor, CppValue left, const std::string& op, int level) {
  CppValue right;
  const ProgramLines before = separate([&] { right = settle(parse_binary(cursor, level + 1)); });
  if (before.empty()) {
    auto result = cpp_binary(std::move(left), op, std::move(right));
    if (!result) give_up("'{}' in an expression has no counterpart", op);
    return *result;
  }
  const CppValue result = store_new(cpp_condition(std::move(left)));
  emit(*prelude_, prelude_depth_, fmt::format("if({} {} 0)", result.text, op == "&&" ? "!=" : "=="));
  prelude_->insert(prelude_->end(), before.begin(), before.end());
  emit(*prelude_, prelude_depth_ + 1,
       fmt::format("{} = {}", result.text, cpp_condition(std::move(right)).text));
  emit(*prelude_, prelude_depth_, "endif");
  return value_of(result.text, CppType::kBool, {0, 1});
}

CppValue KernelTranslation::parse_unary(Cursor& cursor) {
  const Nesting nesting(depth_, "the expression");
  const KernelToken& token = cursor.peek();
  if (token.is("-") || token.is("+") || token.is("~") || token.is("!") || token.is_name("not")) {
    ++cursor.i;
    CppValue value = settle(parse_unary(cursor));
    if (!is_scalar(value.type) || (token.is("~") && value.type == CppType::kFloat))
      give_up("'{}' in an expression has no counterpart", token.text);
    if (token.is("+")) return cpp_promote(std::move(value));
    if (token.is("-")) return cpp_negative(std::move(value));
    return token.is("~") ? cpp_complement(std::move(value)) : cpp_not(std::move(value));
  }
  if (token.is("++") || token.is("--")) {
    const KernelTokenList words{cursor.peek(1),
                                {Kind::kPunctuator, token.text.substr(1) + "=", token.line},
                                {Kind::kNumber, "1", token.line}};
    cursor.i += 2;
    Cursor inner{words};
    return parse_assignment(inner);
  }
  return parse_primary(cursor);
}

CppValue KernelTranslation::parse_cast(Cursor& cursor, CppType type) {
  const bool in_brackets = cursor.consume("(");
  CppValue value = settle(in_brackets ? parse_assignment(cursor) : parse_unary(cursor));
  if (in_brackets && !cursor.consume(")")) give_up("')' is missing");
  if (!is_scalar(type) && !is_scalar(value.type)) return value;
  if (!is_scalar(type) || !is_scalar(value.type)) give_up("this cast has no counterpart");
  return cpp_convert(std::move(value), type);
}

CppValue KernelTranslation::parse_primary(Cursor& cursor) {
  const KernelToken& token = cursor.peek();
  if (token.kind == Kind::kNumber) {
    ++cursor.i;
    return number_value(token);
  }
  if (token.is("(")) {
    std::size_t inside = cursor.i + 1;
    if (const auto type = read_type(cursor.tokens, inside);
        type && inside < cursor.tokens.size() && cursor.tokens[inside].is(")")) {
      cursor.i = inside + 1;
      CppValue value = settle(parse_unary(cursor));
      if (!is_scalar(*type) || !is_scalar(value.type)) give_up("this cast has no counterpart");
      return cpp_convert(std::move(value), *type);
    }
    ++cursor.i;
    CppValue value = parse_assignment(cursor);
    if (!cursor.consume(")")) give_up("'{}' in an expression has no counterpart", cursor.peek().text);
    return value;
  }
  if (token.kind == Kind::kName) {
    if (token.text == "static_cast" && cursor.peek(1).is("<")) {
      cursor.i += 2;
      const auto type = read_type(cursor.tokens, cursor.i);
      if (!type || !cursor.consume(">")) give_up("this cast has no counterpart");
      return parse_cast(cursor, *type);
    }
    std::size_t behind = cursor.i;
    if (const auto type = read_type(cursor.tokens, behind);
        type && behind < cursor.tokens.size() && cursor.tokens[behind].is("(")) {
      cursor.i = behind;
      return parse_cast(cursor, *type);
    }
    return parse_name(cursor);
  }
  give_up("'{}' in an expression has no counterpart", token.text);
}

CppValue KernelTranslation::parse_name(Cursor& cursor) {
  KernelToken token = cursor.peek();
  while (cursor.peek(1).is("::")) {
    const std::string scope = cursor.peek().text + "::";
    cursor.i += 2;
    token = cursor.peek();
    if (find_variable(scope + token.text) != nullptr) token.text = scope + token.text;  // of an enum class
  }
  ++cursor.i;
  if (cursor.peek().is("(")) {
    const std::size_t end = run::behind_bracket(cursor.tokens, cursor.i);
    const bool is_closed = cursor.tokens[end - 1].is(")");
    const auto arguments = split_arguments(cursor.tokens, cursor.i + 1, end - (is_closed ? 1 : 0));
    cursor.i = end;
    if (!is_closed) give_up("')' is missing");
    return call_value(token.text, arguments, token.line);
  }
  if (token.text == "true" || token.text == "false")
    return cpp_constant(token.text == "true" ? 1 : 0, CppType::kBool);
  Variable* variable = find_variable(token.text);
  if (variable == nullptr && vocabulary_.names.contains(token.text))
    return value_of(token.text, CppType::kRegister, {});
  if (variable == nullptr) {
    if (unset_.insert(token.text).second) {
      note(token.line, fmt::format("'{}' has no value in the kernels; it is 0", token.text));
      unset_lines_.push_back(fmt::format("{} = 0  // of the program around the kernels", token.text));
    }
    if (cursor.peek().kind == Kind::kPunctuator &&
        (cursor.peek().is("[") || cursor.peek().is("->") || cursor.peek().is(".")))
      give_up("'{}' in an expression has no counterpart", cursor.peek().text);
    scopes_[0][token.text] = {token.text,   CppType::kInt, range_of(CppType::kInt),
                              std::nullopt, false,         flow_.add()};
    variable = &scopes_[0][token.text];
    flow_.leave_out(variable->node, fmt::format("'{}', which is the controller's,", token.text));
  }
  if (variable->type == CppType::kOther) give_up("the array '{}' belongs to the controller", token.text);
  flow_.read(variable->node);
  CppValue value = value_of(variable->text, variable->type, variable->range);
  if (cursor.peek().is("++") || cursor.peek().is("--")) {
    if (!is_scalar(variable->type) || variable->is_const) give_up("'{}' cannot be counted", token.text);
    const std::string op = cursor.peek().text.substr(1);
    ++cursor.i;
    const CppValue kept = store_new(value);
    flow_.write(variable->node);
    const auto next = cpp_binary(value, op, cpp_constant(1, CppType::kInt));
    variable->range = range_of(variable->type);
    emit(*prelude_, prelude_depth_, fmt::format("{} = {}", value.text, cpp_convert(*next, value.type).text));
    return kept;
  }
  if (variable->constant) {
    value.constant = variable->constant;
    value.range = {*variable->constant, *variable->constant};
    value.binding = *value.constant < 0 && value.text[0] == '-' ? Binding::kSign : Binding::kPrimary;
  }
  return value;
}

CppValue KernelTranslation::call_value(const std::string& name, const std::vector<KernelTokenList>& arguments,
                                       std::size_t line) {
  static const std::map<std::string, std::string> kFloat = {
      {"sqrt", "math.sqrt"}, {"sqrtf", "math.sqrt"}, {"floor", "math.floor"}, {"floorf", "math.floor"},
      {"ceil", "math.ceil"}, {"fabs", "abs"},        {"fabsf", "abs"},        {"round", "math.round"}};
  const auto function = kFloat.find(name);
  if (function != kFloat.end() && arguments.size() == 1 && find_function(name, 1) == nullptr) {
    CppValue value = settle(expression(arguments[0], *prelude_, prelude_depth_));
    return value_of(fmt::format("{}({})", function->second, value.text), CppType::kFloat,
                    range_of(CppType::kFloat));
  }
  const bool is_extreme = (name == "min" || name == "max") && arguments.size() == 2;
  const bool is_abs = name == "abs" && arguments.size() == 1;
  if ((is_extreme || is_abs) && find_function(name, arguments.size()) == nullptr) {
    std::vector<CppValue> values;
    CppType type = CppType::kInt;
    for (const KernelTokenList& argument : arguments) {
      values.push_back(settle(expression(argument, *prelude_, prelude_depth_)));
      if (!is_scalar(values.back().type)) give_up("'{}' of a register has no counterpart", name);
      type = cpp_common_type(type, values.back().type);
    }
    std::string text;
    for (CppValue& value : values)
      text += (text.empty() ? "" : ", ") + cpp_convert(std::move(value), type).text;
    return value_of(fmt::format("{}({})", name, text), type, range_of(type));
  }
  if (name == "vs_gui_read_slider" && arguments.size() == 1)
    if (const auto control = control_value(plain_text(arguments[0]))) return *control;
  CppType result = CppType::kInt;
  CppValue value;
  value.text = join_arguments(name, arguments, true, result);
  value.type = result;
  value.range = range_of(result);
  value.is_call = true;
  static_cast<void>(line);
  return value;
}

void KernelTranslation::call_statement(const std::string& name, const std::vector<KernelTokenList>& arguments,
                                       std::size_t line, ProgramLines& out, int depth) {
  with_prelude(out, depth, [&] {
    CppType result = CppType::kVoid;
    const std::string text = join_arguments(name, arguments, false, result);
    emit(out, depth, result == CppType::kVoid ? text : fmt::format("{} = {}", new_name("unused"), text));
  });
  note_shared_operands(name, arguments, line);
}

std::string KernelTranslation::register_argument(const KernelTokenList& tokens) {
  KernelTokenList words = tokens;
  if (words.size() == 2 && words[0].is("&")) words.erase(words.begin());
  ProgramLines lines;
  const CppValue value = expression(words, lines, 0);
  if (value.type != CppType::kRegister || !lines.empty())
    give_up("'{}' is not a register that is known here", plain_text(tokens));
  return value.text;
}

// An operand of an instruction of the library.
std::string KernelTranslation::argument(const std::string& function, std::size_t index,
                                        const KernelTokenList& tokens) {
  CppValue value = settle(expression(tokens, *prelude_, prelude_depth_));
  if (!is_scalar(value.type)) return value.text;
  return cpp_convert(std::move(value), interface_type(function, index).value_or(CppType::kInt)).text;
}

std::string KernelTranslation::function_arguments(const Signature& function,
                                                  const std::vector<KernelTokenList>& arguments) {
  std::string text;
  for (std::size_t i = 0; i < function.parameters.size(); ++i) {
    const Parameter& parameter = function.parameters[i];
    const bool is_default = i >= arguments.size();
    const KernelTokenList& tokens = is_default ? *parameter.initial : arguments[i];
    const FileScope scope(*this, is_default);  // a default argument means the names where the function is
    std::string one;
    const ValueFlow::Part part(flow_);
    if (parameter.is_any) {
      one = settle(expression(tokens, *prelude_, prelude_depth_)).text;
      flow_.write(parameter.node);
    } else if (parameter.type == CppType::kRegister) {
      one = register_argument(tokens);
    } else if (parameter.type == CppType::kOther) {
      one = "0";  // of the controller: the function cannot use it
    } else if (parameter.is_reference) {
      Variable* variable = tokens.size() == 1 ? find_variable(tokens[0].text) : nullptr;
      if (variable == nullptr || variable->type != parameter.type)
        give_up("'{}' is no variable that '{}' can write", plain_text(tokens), function.name);
      variable->range = range_of(variable->type);
      one = variable->text;
      flow_.read(variable->node);
      flow_.write(parameter.node);
      flow_.flow(parameter.node, variable->node);
      flow_.write(variable->node);
    } else {
      CppValue value = settle(expression(tokens, *prelude_, prelude_depth_));
      if (!is_scalar(value.type)) give_up("'{}' is not a number", plain_text(tokens));
      one = cpp_convert(std::move(value), parameter.type).text;
      flow_.write(parameter.node);
    }
    text += (text.empty() ? "(" : ", ") + one;
  }
  return text.empty() ? text : text + ")";
}

std::string KernelTranslation::join_arguments(const std::string& name,
                                              const std::vector<KernelTokenList>& arguments, bool value,
                                              CppType& result) {
  const auto& table = value ? vocabulary_.values : vocabulary_.statements;
  const auto found = table.find(name);
  const Signature* function = find_function(name, arguments.size());
  if (function == nullptr && (found == table.end() || !found->second.contains(arguments.size())) &&
      require_function(name, arguments.size()))
    function = find_function(name, arguments.size());
  if (function != nullptr) {
    if (value && function->result == CppType::kVoid) give_up("'{}' has no value", name);
    const Signature signature = *function;
    result = signature.result;
    called_.insert(signature.name);
    flow_.guard(signature.call);
    const std::string text = signature.name + function_arguments(signature, arguments);
    flow_.read(signature.value);
    return text;
  }
  if (functions_.contains(name) && found == table.end())
    give_up("'{}' takes another number of arguments than {}", name, arguments.size());
  if (found == table.end()) {
    std::vector<std::string> known;
    for (const auto& [mnemonic, arities] : table) known.push_back(mnemonic);
    if (!value && vocabulary_.values.contains(name) &&
        vocabulary_.values.at(name).contains(arguments.size())) {
      result = CppType::kInt;  // a value that the kernel does not use
      return join_arguments(name, arguments, true, result);
    }
    if (in_kernel_) give_up("scamp5.aps has no instruction '{}'{}", name, common::did_you_mean(name, known));
    give_up("'{}' runs on the controller or host", name);
  }
  if (!found->second.contains(arguments.size())) {
    std::string counts;
    for (const std::size_t arity : found->second)
      counts += (counts.empty() ? "" : " or ") + std::to_string(arity);
    give_up("'{}' takes {} arguments, not {}", name, counts, arguments.size());
  }
  std::string text;
  for (std::size_t i = 0; i < arguments.size(); ++i)
    text += (text.empty() ? "(" : ", ") + argument(name, i, arguments[i]);
  // A read-out writes nothing, unless it goes through a register.
  if (!value || name == "scamp5_global_count" || name == "scamp5_global_sum_sparse")
    flow_.instruction(place_);
  ++instructions_;
  result = value ? CppType::kInt : CppType::kVoid;
  return name + text + (text.empty() ? "" : ")");
}

}  // namespace apron::run
