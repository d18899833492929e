// Writes kernels as C functions; those that differ in constants alone become one.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "apron/target_c/Schedule.h"

namespace apron::target_c {

// The value of an element-wise instruction as a C expression by the functions of elementwise.def with that
// prefix. Empty text for other instructions.
struct OperationText {
  std::string value;
  bool is_mathematics = false;
};
const OperationText& operation_text(program::Opcode op);

// `text` with the operands in place of a, b and c, and its functions prefixed.
std::string expand(const std::string& text, const std::string& prefix,
                   const std::vector<std::string>& operands);

// "math_sin": the function of a mathematical instruction in the generated code.
std::string mathematics_function(program::Opcode op);

// A float, a scalar, or a cell of that type, as a C literal. Integers are limited to the type's values.
std::string float_text(float value);
std::string wide_text(double value);
std::string cell_text(program::CellType type, double value);

// "uint8_": the prefix of the functions of that type.
std::string type_prefix(program::CellType type);
// The expression of a scalar as a cell of that type.
std::string scalar_as_cell(program::CellType type, const std::string& scalar);

class KernelWriter {
 public:
  explicit KernelWriter(const TileProgram& program) : program_(program) {}

  // Adds a kernel; its call is text(call(i)) once all are known. scalar(id) is the expression of a scalar
  // that is known at run time only.
  std::size_t add(const Region& region, const RegionSchedule& schedule, const Step& step,
                  const std::map<NodeId, std::string>& scalars);
  std::size_t add_move(const Move& move);
  std::size_t add_imposition(const Region& region, const Step& step,
                             const std::map<NodeId, std::string>& scalars);

  // The functions, and the statement that calls a kernel. Valid after all kernels were added.
  std::string functions();
  std::string call(std::size_t index) const;

  const std::set<program::Opcode>& mathematics() const { return mathematics_; }
  bool uses_random_integers() const { return uses_random_integers_; }
  std::size_t function_count() const { return shapes_.size(); }

 private:
  // A kernel without its constants, which are numbered in the text between \1 and \2.
  struct Constant {
    std::string text;
    const char* c_type;
  };
  struct Shape {
    std::vector<std::string> parameters;
    std::string body;
    std::vector<std::vector<Constant>> constants;  // of each call
    std::vector<int> parameter_of;                 // of a constant: its number among the parameters, or -1
  };
  struct Call {
    std::size_t shape = 0, instance = 0;
    std::vector<std::string> arguments;
    std::string statement;  // instead of a shape's call
  };
  class Body;

  std::size_t add_call(std::vector<std::string> parameters, std::vector<std::string> arguments,
                       const std::string& body, std::vector<Constant> constants);

  const TileProgram& program_;
  std::map<std::string, std::size_t> index_;
  std::vector<Shape> shapes_;
  std::vector<Call> calls_;
  std::set<program::Opcode> mathematics_;
  bool uses_random_integers_ = false;
};

bool is_word(char c);  // of an identifier
void replace_all(std::string& text, const std::string& from, const std::string& to);
// The plane's pointer to the cell at row 0, column 0, by the macro of its layout: "OWN_TRUTHS(3)".
std::string plane_text(const Place& place);
std::string plane_macro(const Layout& layout);
// "sense_colour_r"
std::string channel_member(const Channel& channel);

}  // namespace apron::target_c
