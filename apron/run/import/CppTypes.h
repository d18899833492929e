// The scalar types of C++ as `apron import` needs them: their ranges, and values of expressions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace apron::run {

enum class CppType : std::uint8_t {
  kVoid,
  kBool,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt,
  kUint,
  kFloat,
  kRegister,  // a register, direction or other name of the machine
  kOther,     // of the controller: arrays, pointers, structures
};

constexpr bool is_integer(CppType type) { return type >= CppType::kBool && type <= CppType::kUint; }
constexpr bool is_scalar(CppType type) { return type >= CppType::kBool && type <= CppType::kFloat; }
constexpr int bits_of(CppType type) {
  switch (type) {
    case CppType::kBool:
      return 1;
    case CppType::kInt8:
    case CppType::kUint8:
      return 8;
    case CppType::kInt16:
    case CppType::kUint16:
      return 16;
    default:
      return 32;
  }
}
constexpr bool is_signed(CppType type) {
  return type == CppType::kInt8 || type == CppType::kInt16 || type == CppType::kInt;
}

struct CppRange {
  double low = 0, high = 0;
  bool within(const CppRange& other) const { return low >= other.low && high <= other.high; }
};
CppRange range_of(CppType);

// How tightly the outermost operator of an expression in APRON binds.
enum class Binding : std::uint8_t { kOr, kAnd, kComparison, kSum, kProduct, kSign, kPrimary };

// An expression in APRON, with its type and range in C++.
struct CppValue {
  std::string text;
  CppType type = CppType::kInt;
  Binding binding = Binding::kPrimary;
  CppRange range = range_of(CppType::kInt);
  std::optional<double> constant;
  bool is_call = false;  // of something that executes instructions or statements

  // In brackets if it binds less tightly than that.
  std::string bound(Binding at_least) const { return binding < at_least ? "(" + text + ")" : text; }
};

CppValue cpp_constant(double value, CppType type);
// The value after a conversion of C++: truncated, wrapped or compared with 0.
CppValue cpp_convert(CppValue value, CppType to);
// The value of `a op b` after the usual conversions; nothing for operators without a counterpart.
std::optional<CppValue> cpp_binary(CppValue a, std::string_view op, CppValue b);
// As an operand of an operator: of type int at least.
CppValue cpp_promote(CppValue);
CppValue cpp_negative(CppValue);
CppValue cpp_complement(CppValue);
CppValue cpp_not(CppValue);
// Converts to the condition of an `if`.
CppValue cpp_condition(CppValue);
// The type of both operands of an arithmetic operator.
CppType cpp_common_type(CppType a, CppType b);

}  // namespace apron::run
