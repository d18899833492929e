// The syntax tree: a flat list of statements, each with expression trees. Blocks are not nested here, so that
// a macro may open one that another closes; the compiler pairs them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/SourceManager.h"

namespace apron::syntax {

// Maximum depth of an expression, macro bodies included. The operators of a + b + c are on one level.
inline constexpr std::size_t kMaxExpressionDepth = 200;
// Maximum height of an expression's tree, in which each of them is below the next.
inline constexpr std::size_t kMaxExpressionHeight = 500;

enum class ExpressionKind : std::uint8_t {
  kNumber,     // number
  kString,     // text
  kName,       // text: a register, scalar or instruction without arguments
  kElement,    // text[child 0]: an element of a class, by name or number
  kCall,       // text(children)
  kUnary,      // text is - + ! or not
  kBinary,     // text is the operator
  kOperator,   // a comparison sign as an argument: if(a,<,b)
  kLabel,      // #text
  kModule,     // ? : text is the current module's name
  kExpansion,  // a macro with a result
};

struct MacroExpansion;

struct Expression {
  ExpressionKind kind = ExpressionKind::kNumber;
  Location location;
  std::string text;
  double number = 0.0;
  std::uint32_t owner = 0;  // of a macro's local name: the number of the expansion that it belongs to
  std::vector<Expression> children;
  std::shared_ptr<MacroExpansion> expansion;
  std::size_t depth = 1, height = 1;
};

// An argument of more than one token: evaluated once, before the macro's body.
struct ArgumentBinding {
  std::string name;  // unique in the program, begins with '$'
  Expression value;
};

enum class StatementKind : std::uint8_t {
  kAssign,      // target = value
  kCall,        // value is a kCall or kName
  kLabel,       // target.text
  kDeclare,     // declaration
  kMacroBegin,  // a macro's body begins: expansion has its bindings, its body follows in the list
  kMacroEnd,    // and ends
  kInvalid,     // already reported; target.text is its first word, assigns if it had a '='
};

struct Statement {
  StatementKind kind = StatementKind::kInvalid;
  Location location;
  Expression target;
  Expression value;
  std::shared_ptr<Declaration> declaration;
  std::shared_ptr<MacroExpansion> expansion;
  std::uint32_t expansion_id = 0;  // of kMacroBegin and kMacroEnd
  bool assigns = false;            // of kInvalid
};

// What a parameter or result stands for: a kOperator if that is no value, with its text.
struct Argument {
  std::string parameter;
  ArgumentType type = ArgumentType::kAny;
  bool is_array = false;
  Expression value;
};

struct MacroExpansion {
  std::uint32_t id = 0;
  std::string macro;
  bool is_function = false;
  std::vector<std::string> results;  // of a function: its local names
  std::vector<Argument> arguments;   // of the parameters, then the caller's targets
  // Unique name that the body writes the result to; "" if it writes the caller's target.
  std::string result_name;
  std::vector<ArgumentBinding> bindings;
  std::vector<Statement> body;  // empty for kMacroBegin
};

}  // namespace apron::syntax
