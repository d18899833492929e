#include "apron/run/import/CppTypes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace apron::run {
namespace {

constexpr double kTwo32 = 4294967296.0;

bool is_negative_number(const CppValue& value) { return value.constant && *value.constant < 0; }

std::string number_text(double value, CppType type) {
  if (type != CppType::kFloat || value == std::floor(value)) return fmt::format("{:.0f}", value);
  return fmt::format("{}", static_cast<float>(value));
}

// The whole number, wrapped as a conversion to the type does.
double wrapped(double value, CppType type) {
  if (type == CppType::kBool) return value != 0.0 ? 1.0 : 0.0;
  const double modulus = std::ldexp(1.0, bits_of(type));
  double rest = value - modulus * std::floor(value / modulus);
  if (is_signed(type) && rest >= modulus / 2) rest -= modulus;
  return rest;
}

CppValue call(std::string text, CppType type) {
  CppValue value;
  value.text = std::move(text);
  value.type = type;
  value.range = range_of(type);
  return value;
}

CppValue infix(const CppValue& a, std::string_view op, const CppValue& b, Binding binding, CppType type,
               CppRange range) {
  // The right operand of - and / must bind more tightly. A negative number stands in brackets.
  const auto tighter = static_cast<Binding>(static_cast<int>(binding) + 1);
  const bool is_regrouped = op == "-" || op == "/" || binding == Binding::kComparison;
  CppValue value;
  value.text = fmt::format(
      "{} {} {}", binding == Binding::kComparison ? a.bound(tighter) : a.bound(binding), op,
      is_negative_number(b) ? "(" + b.text + ")"
                            : b.bound(is_regrouped || type == CppType::kFloat ? tighter : binding));
  value.type = type;
  value.binding = binding;
  value.range = range;
  return value;
}

CppRange sum(const CppRange& a, const CppRange& b) { return {a.low + b.low, a.high + b.high}; }
CppRange product(const CppRange& a, const CppRange& b) {
  const auto [low, high] = std::minmax({a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high});
  return {low, high};
}

// A result of the type: signed overflow is undefined, unsigned numbers wrap.
CppValue finish_arithmetic(CppValue value) {
  if (value.type == CppType::kFloat) return value;
  const CppRange limits = range_of(value.type);
  if (value.range.within(limits)) return value;
  if (value.type == CppType::kUint)
    return call(fmt::format("cpp.unsigned({}, 32)", value.text), CppType::kUint);
  value.range = limits;
  return value;
}

std::optional<double> fold(double a, std::string_view op, double b, CppType type) {
  const bool whole = type != CppType::kFloat;
  if (op == "+") return a + b;
  if (op == "-") return a - b;
  if (op == "*" && std::fabs(a * b) < 9007199254740992.0) return a * b;
  if (op == "/" && b != 0.0) return whole ? std::trunc(a / b) : a / b;
  if (op == "%" && b != 0.0) return std::fmod(a, b);
  if (!whole) return std::nullopt;
  const auto bits = [](double v) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(v)); };
  if (op == "<<" && b >= 0 && b < 32) return static_cast<double>(bits(a) << static_cast<unsigned>(b));
  if (op == ">>" && b >= 0 && b < 32) return std::floor(std::ldexp(a, -static_cast<int>(b)));
  if (op == "&") return static_cast<double>(bits(a) & bits(b));
  if (op == "|") return static_cast<double>(bits(a) | bits(b));
  if (op == "^") return static_cast<double>(bits(a) ^ bits(b));
  return std::nullopt;
}

bool is_comparison(std::string_view op) {
  return op == "<" || op == ">" || op == "<=" || op == ">=" || op == "==" || op == "!=";
}

double compare(double a, std::string_view op, double b) {
  const bool truth = op == "<"    ? a < b
                     : op == ">"  ? a > b
                     : op == "<=" ? a <= b
                     : op == ">=" ? a >= b
                     : op == "==" ? a == b
                                  : a != b;
  return truth ? 1.0 : 0.0;
}

}  // namespace

CppRange range_of(CppType type) {
  switch (type) {
    case CppType::kBool:
      return {0, 1};
    case CppType::kInt8:
    case CppType::kInt16:
    case CppType::kInt:
      return {-std::ldexp(1.0, bits_of(type) - 1), std::ldexp(1.0, bits_of(type) - 1) - 1};
    case CppType::kUint8:
    case CppType::kUint16:
    case CppType::kUint:
      return {0, std::ldexp(1.0, bits_of(type)) - 1};
    default:
      return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  }
}

CppValue cpp_constant(double value, CppType type) {
  value += 0.0;  // 0 has no sign
  CppValue result;
  result.text = number_text(value, type);
  result.type = type;
  result.binding = value < 0 ? Binding::kSign : Binding::kPrimary;
  result.range = {value, value};
  result.constant = value;
  return result;
}

CppType cpp_common_type(CppType a, CppType b) {
  if (a == CppType::kFloat || b == CppType::kFloat) return CppType::kFloat;
  return a == CppType::kUint || b == CppType::kUint ? CppType::kUint : CppType::kInt;
}

CppValue cpp_convert(CppValue value, CppType to) {
  if (value.type == to || !is_scalar(value.type) || !is_scalar(to)) return value;
  if (to == CppType::kBool) return cpp_condition(std::move(value));
  if (to == CppType::kFloat) {
    if (value.constant && static_cast<float>(*value.constant) != *value.constant)
      return cpp_constant(static_cast<float>(*value.constant), to);
    value.type = to;
    return value;
  }
  if (value.type == CppType::kFloat) {
    if (value.constant) return cpp_convert(cpp_constant(std::trunc(*value.constant), CppType::kInt), to);
    return cpp_convert(call(fmt::format("cpp.int({})", value.text), CppType::kInt), to);
  }
  if (value.constant) {
    const double converted = wrapped(*value.constant, to);
    if (converted == *value.constant) {  // keeps the text, which may be a name
      value.type = to;
      return value;
    }
    return cpp_constant(converted, to);
  }
  if (value.range.within(range_of(to))) {
    value.type = to;
    return value;
  }
  return call(fmt::format("cpp.{}({}, {})", is_signed(to) ? "signed" : "unsigned", value.text, bits_of(to)),
              to);
}

CppValue cpp_condition(CppValue value) {
  if (value.constant) return cpp_constant(*value.constant != 0.0 ? 1 : 0, CppType::kBool);
  if (value.range.within({0, 1}) && value.type != CppType::kFloat) {
    value.type = CppType::kBool;
    return value;
  }
  return infix(value, "!=", cpp_constant(0, CppType::kInt), Binding::kComparison, CppType::kBool, {0, 1});
}

CppValue cpp_not(CppValue value) {
  if (value.constant) return cpp_constant(*value.constant == 0.0 ? 1 : 0, CppType::kBool);
  return infix(value, "==", cpp_constant(0, CppType::kInt), Binding::kComparison, CppType::kBool, {0, 1});
}

CppValue cpp_promote(CppValue value) {
  const CppType type = cpp_common_type(value.type, CppType::kInt);
  return cpp_convert(std::move(value), type);
}

CppValue cpp_negative(CppValue value) {
  value = cpp_promote(std::move(value));
  const CppType type = value.type;
  if (value.constant)
    return cpp_constant(type == CppType::kFloat ? -*value.constant : wrapped(-*value.constant, type), type);
  CppValue result;
  result.type = type;
  result.binding = Binding::kSign;
  result.text = "-" + value.bound(Binding::kPrimary);
  result.range = {-value.range.high, -value.range.low};
  return finish_arithmetic(std::move(result));
}

CppValue cpp_complement(CppValue value) {
  const CppType type = cpp_common_type(value.type, CppType::kInt);
  return *cpp_binary(cpp_constant(type == CppType::kUint ? kTwo32 - 1 : -1, type), "-", std::move(value));
}

std::optional<CppValue> cpp_binary(CppValue a, std::string_view op, CppValue b) {
  if (!is_scalar(a.type) || !is_scalar(b.type)) return std::nullopt;
  if (op == "&&" || op == "||") {
    a = cpp_condition(std::move(a));
    b = cpp_condition(std::move(b));
    if (a.constant && b.constant)
      return cpp_constant(op == "&&" ? *a.constant * *b.constant : std::max(*a.constant, *b.constant),
                          CppType::kBool);
    return infix(a, op, b, op == "&&" ? Binding::kAnd : Binding::kOr, CppType::kBool, {0, 1});
  }
  const bool is_shift = op == "<<" || op == ">>";
  const CppType type = is_shift ? cpp_common_type(a.type, CppType::kInt) : cpp_common_type(a.type, b.type);
  a = cpp_convert(std::move(a), type);
  b = cpp_convert(std::move(b), is_shift ? cpp_common_type(b.type, CppType::kInt) : type);
  if (is_comparison(op)) {
    if (a.constant && b.constant) return cpp_constant(compare(*a.constant, op, *b.constant), CppType::kBool);
    return infix(a, op, b, Binding::kComparison, CppType::kBool, {0, 1});
  }
  if (type == CppType::kFloat && (op == "%" || is_shift)) return std::nullopt;
  if (a.constant && b.constant) {
    if (const auto value = fold(*a.constant, op, *b.constant, type)) {
      if (type != CppType::kFloat) return cpp_constant(wrapped(*value, type), type);
      const auto rounded = static_cast<float>(*value);
      if (std::isfinite(rounded)) return cpp_constant(rounded, type);
    }
  }
  if (op == "+") return finish_arithmetic(infix(a, op, b, Binding::kSum, type, sum(a.range, b.range)));
  if (op == "-")
    return finish_arithmetic(
        infix(a, op, b, Binding::kSum, type, sum(a.range, {-b.range.high, -b.range.low})));
  if (op == "*") {
    const CppRange range = product(a.range, b.range);
    const bool is_exact = std::max(-range.low, range.high) < 9007199254740992.0;
    if (type == CppType::kUint && !is_exact)
      return call(fmt::format("cpp.multiply({}, {})", a.text, b.text), CppType::kUint);
    return finish_arithmetic(infix(a, op, b, Binding::kProduct, type, range));
  }
  if (op == "/" && type == CppType::kFloat)
    return infix(a, op, b, Binding::kProduct, type, range_of(CppType::kFloat));
  static const std::array<std::pair<std::string_view, std::string_view>, 7> kFunctions = {{{"/", "divide"},
                                                                                           {"%", "remainder"},
                                                                                           {"<<", "left"},
                                                                                           {">>", "right"},
                                                                                           {"&", "and"},
                                                                                           {"|", "or"},
                                                                                           {"^", "xor"}}};
  for (const auto& [symbol, name] : kFunctions) {
    if (op != symbol) continue;
    CppValue result = call(fmt::format("cpp.{}({}, {})", name, a.text, b.text), type);
    // These give the unsigned number of 32 bits.
    if (type == CppType::kInt && (op == "<<" || op == "&" || op == "|" || op == "^"))
      result.text = fmt::format("cpp.signed({}, 32)", result.text);
    if (op == "&" && std::min(a.range.low, b.range.low) >= 0)
      result.range = {0, std::min(a.range.high, b.range.high)};
    if (op == "/" && a.range.low >= 0 && b.range.low >= 0) result.range = {0, a.range.high};
    if (op == "%" && a.range.low >= 0 && b.range.low >= 0)
      result.range = {0, std::min(a.range.high, std::max(b.range.high - 1, 0.0))};
    if (op == ">>" && a.range.low >= 0) result.range = {0, a.range.high};
    return result;
  }
  return std::nullopt;
}

}  // namespace apron::run
