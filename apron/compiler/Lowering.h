// Statements to instructions.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apron/compiler/Builtins.h"
#include "apron/compiler/Emitter.h"
#include "apron/compiler/Names.h"
#include "apron/syntax/Ast.h"
#include "apron/syntax/Diagnostic.h"

namespace apron::compiler {

// A read of a scalar, for the check that it can have been written before.
struct ScalarRead {
  std::uint32_t variable = 0;
  std::size_t position = 0;  // the first instruction that may read it
  syntax::Location at;
};

class Lowering {
 public:
  // `other_names` are those of macros and defines, for suggestions.
  Lowering(Shape surface, const syntax::Sources&, syntax::Diagnostics&, std::vector<std::string> other_names);

  void run(const std::vector<syntax::Statement>&);
  program::Program finish();
  const std::vector<ScalarRead>& scalar_reads() const noexcept { return reads_; }

 private:
  using Expression = syntax::Expression;
  using Expressions = std::vector<syntax::Expression>;
  using Location = syntax::Location;
  using Statement = syntax::Statement;

  // Where a value goes. The last instruction of an expression asks for it by target(); what does not ask is
  // copied.
  struct Destination {
    const Expression* expression = nullptr;
    bool used = false;
  };

  enum class BlockKind : std::uint8_t { kIf, kWhile, kFor, kRepeat, kWhere };
  struct Block {
    BlockKind kind = BlockKind::kIf;
    Location at;
    Emitter::Label top = 0, next = 0, end = 0;  // of a loop: its test, its `continue`, what follows it
    bool else_seen = false;
    bool endless = false;  // its opening line was wrong; nothing more to emit for it
    std::uint32_t where_part = 0;
    Shape where_shape;
    Value counter, bound, step;
  };
  struct Scope {  // of one macro expansion
    std::vector<std::string> names;
    std::vector<Value> values;
  };
  struct Target {  // of jumps
    Emitter::Label label = 0;
    bool placed = false;
    std::uint32_t where_part = 0;
    Location at;
  };
  struct JumpSite {
    std::string name;
    std::uint32_t where_part = 0;
    Location at;
    bool call = false;
  };
  struct Condition {
    program::Opcode compare = program::Opcode::kNe;
    Value left, right;
  };

  // Lowering.cpp
  void survey(const std::vector<Statement>&);
  void survey(const Expression&);
  void survey_call(const Expression& call);
  void statement(const Statement&);
  void dispatch(const Statement&);
  void declare(const syntax::Declaration&);
  void assign(const Expression& target, const Expression& value);
  void store(Destination&, const Value&, Location);
  void invalid(const Statement&);
  void enter(const syntax::MacroExpansion&);
  void leave(std::uint32_t expansion);
  void call_statement(const Expression&);
  void perform(const Builtin&, const Expression& call);
  [[noreturn]] void wrong_count(const Builtin&, const Expression& call) const;
  [[noreturn]] void unknown_call(const Expression&) const;
  void check_jumps();

  // LowerExpression.cpp
  Value lower(const Expression&, Destination* = nullptr);
  Value lower_name(const Expression&, Destination* = nullptr);
  Value lower_expansion(const Expression&);
  Value lower_binary(const Expression&, Destination*);
  Value lower_unary(const Expression&, Destination*);
  Value elementwise(program::Opcode, const std::vector<Value>&, Location, Destination*);
  const Symbol& element(const Expression&) const;
  Value target(Destination&, bool is_register, Shape);
  Value place_for(const Expression&, bool is_register, Shape);
  Value local_target(const Expression&, bool is_register, Shape);
  Value new_scalar(const Expression&, bool is_register);
  Value scalar(const Expression&, std::string_view what);
  Value array(const Expression&, std::string_view what);
  std::string namesake(const std::string& name) const;
  Value kept(Value);
  int whole(const Expression&, std::string_view what);
  float constant(const Expression&, std::string_view what);
  const std::string& text(const Expression&, std::string_view what) const;
  std::string describe(const Value&) const;
  void check_shapes(const std::vector<Value>&, Location) const;
  void check_where(Shape, Location) const;
  bool shape_of(const Expression&, Shape&) const;
  bool may_be_masked() const;

  // LowerCall.cpp
  Value lower_call(const Builtin&, const Expression& call, const Expressions& arguments, Destination*);
  Value pixel_get(const Expressions&, Destination*);
  Value parameter(const Expression&, Destination*);
  Value comparison(const Expressions&, Location, Destination*);
  Value to_variable(program::Opcode, std::vector<program::Operand>, Destination*);
  Value to_register(program::Opcode, std::vector<program::Operand>, Destination*);

  // LowerArray.cpp
  Value move(program::Opcode, const Value& source, int dx, int dy, Destination*, Location);
  Value shift(const Builtin&, const Expressions&, Location, Destination*);
  Value near(const Builtin&, const Expressions&, Location, Destination*);
  Value register_size(const Builtin&, const Expressions&);
  std::uint32_t register_number(const Value&, Location) const;
  void pixel_set(const Expressions&);

  // What reads other cells than its own: its destination is none of its sources.
  Value apart(program::Opcode, const std::vector<Value>& sources, std::vector<program::Operand> more,
              Destination*, Location);

  // LowerFilter.cpp
  Value filtered(const Builtin&, const Expressions&, Location, Destination*);
  bool filter_statement(const Builtin&, const Expression& call, const Expressions&);
  std::optional<std::uint32_t> filter_of(std::string_view name) const;
  std::uint32_t find_filter(const Expression& name) const;
  std::uint32_t add_filter(program::Filter);
  Value gauss(const Expressions&, Location, Destination*);
  void set_element(const Expressions&);
  void gabor(const Expressions&);
  void fill(std::uint32_t index, const std::function<double(double, double)>& weight);
  double real(const Expression&, std::string_view what, double low);
  int radius_of(double width, Location) const;
  program::Operand filter(std::uint32_t index) const { return {program::OperandKind::kFilter, index}; }

  // LowerData.cpp
  bool data_statement(const Builtin&, const Expression& call, const Expressions&);
  Value random(const Builtin&, const Expressions&, Location, Destination*);
  Value draw(program::Opcode, const Value& a, const Value& b, Destination*);
  program::Operand group(const Expression& class_name, bool of_variables);
  const std::string& class_of(const Expression&) const;
  Value get_element(const Builtin&, const Expressions&, Location, Destination*);
  Value match(const Expressions&);
  program::Operand module(const Expression&);
  void plugin_arguments(const Expressions&, std::size_t first);
  Value plugin(const Expressions&, Destination*);
  void plugin_statement(const Expression& call);
  void set_colours(const Builtin&, const Expressions&, Location);

  // LowerFlow.cpp
  bool flow(const Builtin&, const Expression& call, const Expressions&);
  Condition condition(const Expressions&, Location);
  Condition expression_condition(const Expression&);
  void jump_unless(const Condition&, Emitter::Label);
  void jump_if(const Condition&, Emitter::Label);
  void open(BlockKind, Location);
  void open_if(const Expressions&, Location);
  void open_while(const Expressions&, Location);
  void open_for(const Expressions&, Location);
  Value held(const Value&);
  void test_for(const Block&);
  void open_repeat(const Expressions&, Location);
  void open_where(const Expressions&, Location);
  void turn_if(Location);
  void turn_where(Location);
  void close(BlockKind, Location);
  void close_loop(const Block&);
  Block& innermost(BlockKind, Location, std::string_view word);
  void leave_loop(bool again, Location);
  void place_label(const std::string&, Location);
  void jump(program::Opcode, const Expression& label);
  Emitter::Label label_for(const Expression&, bool call);
  void finish_blocks(std::size_t floor);
  std::uint32_t where_part() const;

  // LowerHost.cpp
  bool host(const Builtin&, const Expression& call, const Expressions&);
  void print(const Builtin&, const Expressions&);
  void boundary(const Expression&);
  void add_slider(const Expressions&, Location);
  void add_switch(const Expressions&, Location);
  void add_parameter(program::Parameter, Location);
  void show_label(const Expressions&);
  void names_exist(const Expressions&);
  void tile(const Expressions&);
  program::Operand timer(const Expressions&);

  Shape surface_;
  const syntax::Sources& sources_;
  syntax::Diagnostics& diagnostics_;
  std::vector<std::string> other_names_;
  Emitter emitter_;
  Names names_;
  std::set<std::string> written_;  // every name that some statement writes
  bool uses_mask_on_ = false, uses_where_ = false, uses_call_ = false;
  std::vector<Block> blocks_;
  std::map<std::uint32_t, Scope> scopes_;
  std::map<std::string, Target> labels_;
  std::vector<JumpSite> jumps_;
  std::vector<ScalarRead> reads_;
  std::uint32_t where_parts_ = 0;
  std::map<std::string, std::uint32_t> groups_;  // classes that are taken from by number
  bool in_array_ = false;                        // the statement has registers: random numbers are one a cell
  Shape hint_;                                   // for cell.x and the like, which have no shape of their own
};

}  // namespace apron::compiler
