// Lowers statements to instructions.
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/compiler/Builtins.h"
#include "apron/compiler/MacroBody.h"
#include "apron/compiler/ProgramBuilder.h"
#include "apron/compiler/SymbolTable.h"
#include "apron/syntax/Ast.h"
#include "apron/syntax/Diagnostic.h"

namespace apron::compiler {

// A read of a scalar, for definite-assignment analysis.
struct ScalarRead {
  std::uint32_t variable = 0;
  std::size_t instruction = 0;  // the first instruction that may read it
  syntax::Location location;
};

class Lowering {
 public:
  // The preprocessor's input has ended. Its macros and defines are for messages; where it says that the
  // program is one of the original's, calls of its windows and simulators that nothing defines, and palettes
  // that do not exist, are warnings.
  Lowering(Shape surface, const syntax::SourceManager&, syntax::Diagnostics&, const syntax::Preprocessor&);

  // A module that the program loads, whether or not it calls it; its index.
  std::uint32_t add_module(const std::string& name, syntax::Location);
  void lower_program(const std::vector<syntax::Statement>&);
  program::Program finish();
  const std::vector<ScalarRead>& scalar_reads() const noexcept { return scalar_reads_; }

 private:
  using Expression = syntax::Expression;
  using Expressions = std::vector<syntax::Expression>;
  using Location = syntax::Location;
  using Statement = syntax::Statement;

  // Destination of a value. The last instruction of an expression fetches it with target(); other results
  // are copied.
  struct ResultDestination {
    const Expression* target = nullptr;
    bool used = false;
    Value whole = {};  // if not empty, takes the value in place of the target
  };

  struct Block {
    BlockKind kind = BlockKind::kIf;
    Location location;
    std::size_t opening = 0;  // the last instruction before it
    // The labels of a loop: its test, the target of `continue`, and the instruction after the loop.
    ProgramBuilder::Label test_label = 0, continue_label = 0, end_label = 0;
    bool has_else = false;
    bool from_error = false;         // its opening line has an error; emit nothing for it
    std::uint32_t where_region = 0;  // of the innermost `where`, be it this block or around it
    Shape where_shape;
    Value condition;  // of a where: its cells, if registers that ignore masks may be written in it
    Value counter, bound, step;
    Value direction, fraction;  // of a step that is not constant: its sign, what it is beyond a whole number
    // A `for` with a fraction as its step counts its rounds, from 0; its counter is first + round · step.
    Value first, round, last_round;

    bool counts_rounds() const { return round.kind != Value::Kind::kNone; }
  };
  // A register of the caller that a macro's body writes as if there were no masks.
  struct MergedRegister {
    Value value, before;
    std::optional<std::size_t> outer_base;
  };
  // A macro's expansion while its body is lowered.
  struct MacroScope {
    std::vector<std::string> names;  // local ones
    std::vector<Value> values;
    std::vector<program::LocalName> locals;        // the same, for debuggers
    std::map<std::size_t, std::string> unwritten;  // of them: arguments that the body may create
    std::string result_name;
    std::vector<std::string> results;  // of a function: its local names
    std::size_t wheres = 0;            // that were open when the body began
    std::size_t body = 0;              // where it begins: see ProgramBuilder
    // Its local registers ignore base masks, and where-blocks before that many. None: they ignore nothing.
    std::optional<std::size_t> mask_base = std::nullopt;
    std::vector<MergedRegister> merged;
  };
  struct JumpTarget {
    ProgramBuilder::Label label = 0;
    bool is_bound = false;
    std::uint32_t where_region = 0;
    Location location;
    bool is_in_macro = false;
    std::vector<Block> loops;  // around it that count rounds, inner ones last
  };
  struct JumpSite {
    std::string name;
    std::uint32_t where_region = 0;
    Location location;
    std::size_t position = 0;  // of the instruction
    bool is_call = false;
  };
  struct Comparison {
    program::Opcode opcode = program::Opcode::kNe;
    Value left, right;
  };

  // Lowering.cpp
  void collect_writes(const std::vector<Statement>&);
  void collect_writes(const Expression&);
  void note_masks(const Builtin&);
  void lower_statements(std::span<const Statement>);
  void lower_statement(const Statement&);
  void report(const CompileError&);
  void dispatch_statement(const Statement&);
  void lower_resolved(const Statement&);
  bool mentions_text(const Expression&) const;
  void resolve_texts(Expression&) const;
  void define_text(const Expression& target, const Expression& text);
  bool ignores(const Expression& call);
  void lower_declaration(const syntax::Declaration&);
  Symbol declare_element(const syntax::Declaration&, const std::string& name);
  void declare_array(const syntax::Declaration&);
  // Reports a name that is an instruction without arguments, or a keyword.
  void require_free_name(const std::string& name, Location) const;
  void lower_assignment(const Expression& target, const Expression& value);
  void assign(const Expression& target, Location,
              const std::function<Value(ResultDestination*)>& lower_value);
  void assign_copy(const Expression& target, bool is_indexed, Location,
                   const std::function<Value(ResultDestination*)>& lower_value);
  void store_result(ResultDestination&, const Value&, Location);
  void recover_from_error(const Statement&);
  void lower_call_statement(const Expression&);
  void lower_builtin_statement(const Builtin&, const Expression& call);
  [[noreturn]] void fail_argument_count(const Builtin&, const Expression& call) const;
  [[noreturn]] void fail_unknown_call(const Expression&) const;
  void check_jumps();

  // LowerMacro.cpp
  std::span<const Statement> body_of(std::uint32_t expansion) const;
  void check_arguments(const syntax::MacroExpansion&) const;
  Value lower_argument(const Expression&);
  void enter_macro(const syntax::MacroExpansion&, std::span<const Statement> body);
  void leave_macro(std::uint32_t expansion);
  program::LocalName local_name(std::string name, const Value& = {});
  program::LocalName local_array(std::string name, const std::vector<Symbol>&);
  program::LocalName local_argument(std::string name, const Expression& argument);
  Value lower_expansion(const Expression&);
  bool always_writes_result(const syntax::MacroExpansion&, const MacroBody&) const;
  void check_unmasked_result(const Expression& target) const;
  bool is_reduction(const syntax::MacroExpansion&) const;
  Value create_macro_local(const Expression&, bool is_register, Shape);
  void isolate_from_masks(MacroScope&, const MacroBody&, Location);
  void merge_registers(MacroScope&);
  void set_mask_base(const Value&, std::optional<std::size_t>);
  std::optional<std::size_t> mask_base(const Value&) const;
  std::optional<std::size_t> mask_base(const Expression& target) const;
  std::size_t open_wheres() const;
  std::vector<Value> conditions_since(std::optional<std::size_t> mask_base) const;
  void emit_selection(const Value& target, const Value& value, std::vector<Value> conditions, Location);
  Value where_condition(const Value& mask);

  // LowerIndexed.cpp
  bool is_array_element(const Expression&) const;
  std::optional<double> constant_value(const Expression&) const;
  const Symbol* array_element(const Expression&) const;
  std::vector<Value> written_registers(const Expression& target) const;
  // The registers of a class that have that size.
  std::vector<Value> registers_of_class(const std::string& name, Shape) const;
  program::Operand array_operand(const std::string& name);
  Value lower_array_element(const Expression&);
  void assign_array_element(const Expression& target, const Value&, Location);
  void lower_set_register(const Builtin&, const Expression& call);
  const std::vector<Symbol>& array_argument(const Expression&, bool of_registers) const;
  [[noreturn]] void fail_conditionally(Location, std::string message);
  void lower_matrix_product(const Expressions&, Location);

  // LowerExpression.cpp
  Value lower(const Expression&, ResultDestination* = nullptr);
  void check_no_array(const Expression& name) const;
  Value lower_name(const Expression&, ResultDestination* = nullptr);
  Value lower_binary(const Expression&, ResultDestination*);
  bool has_calls(const Expression&) const;
  bool is_scalar(const Expression&) const;
  Value lower_short_circuit(program::Opcode, const Expression&);
  Value lower_unary(const Expression&, ResultDestination*);
  Value emit_elementwise(program::Opcode, const std::vector<Value>&, Location, ResultDestination*);
  const Symbol& find_element(const Expression&) const;
  const Symbol* find_element_or_null(const Expression&) const;
  Value resolve_destination(ResultDestination&, bool is_register, Shape);
  Value resolve_target(const Expression&, bool is_register, Shape);
  Value create_scalar(const Expression&, bool is_register);
  const Symbol& add_scalar(const Expression& name);
  Value lower_scalar(const Expression&, std::string_view subject, std::string_view hint = {});
  Value lower_condition_operand(const Expression&);
  Value lower_register(const Expression&, std::string_view subject);
  std::string same_name_hint(const std::string& name) const;
  Value retained(Value);
  int integer_constant(const Expression&, std::string_view subject);
  float number_constant(const Expression&, std::string_view subject);
  const std::string& string_literal(const Expression&, std::string_view subject) const;
  std::string describe_name(const Value&, std::string_view unnamed = "another operand") const;
  std::string describe_shape(const Value&) const;
  void check_shapes(const std::vector<Value>&, Location) const;
  void check_types(program::Opcode, const std::vector<Value>& registers, Location) const;
  void require_floats(const Builtin&, const Value&, Location) const;
  void check_result_type(program::Opcode, const Value& result) const;
  void emit_fill(program::Opcode, const Value& result, std::vector<program::Operand>, bool masked);
  void check_cell_values(Shape, const std::vector<Value>&, Location) const;
  Value lower_conversion(const Builtin&, const Expression& argument, Location, ResultDestination*);
  Value emit_conversion(program::Opcode, const Value&, program::CellType, ResultDestination*, Location);
  Value truth_of_type(const Value& condition, program::CellType, Location);
  void check_where_shape(Shape, Location, std::optional<std::size_t> mask_base) const;
  bool find_shape(const Expression&, Shape&) const;
  bool may_be_masked() const;
  bool is_foreign(std::uint32_t machine_file) const;
  void check_no_later_macro(const Expression&) const;
  std::string machine_hint(std::initializer_list<std::string_view> mnemonics) const;
  const std::uint32_t* foreign_machine(const Value&) const;
  void check_machine_copy(const Value& target, const Value& value, Location) const;
  void check_machine_read(program::Opcode, const std::vector<Value>&, Location) const;

  // LowerCall.cpp
  Value lower_call(const Builtin&, const Expression& call, const Expressions& arguments, ResultDestination*);
  std::vector<program::Operand> lower_operands(const Builtin&, const Expression& call, const Expressions&);
  Value lower_parameter(const Expression&, ResultDestination*);
  Value lower_comparison(const Expressions&, Location, ResultDestination*);
  Value emit_to_scalar(program::Opcode, std::vector<program::Operand>, ResultDestination*);
  Value emit_to_register(program::Opcode, std::vector<program::Operand>, ResultDestination*);

  // LowerArray.cpp
  Value emit_shift(program::Opcode, const Value& source, int dx, int dy, ResultDestination*, Location);
  Value lower_shift(const Builtin&, const Expressions&, Location, ResultDestination*);
  Value lower_variable_shift(const Builtin&, const Expression& source, const std::vector<Value>& distances,
                             ResultDestination*, Location);
  Value lower_neighbourhood(const Builtin&, const Expressions&, Location, ResultDestination*);
  Value lower_register_property(const Builtin&, const Expressions&);
  std::uint32_t register_number(const Value&, Location) const;
  void lower_pixel_set(const Expressions&);

  // For instructions that read other cells: the destination is none of the sources.
  Value lower_propagation(const Builtin&, const Expressions&, Location, ResultDestination*);
  Value lower_scatter(const Builtin&, const Expressions&, Location, ResultDestination*);
  Value emit_out_of_place(program::Opcode, const std::vector<Value>& sources,
                          std::vector<program::Operand> extra_operands, ResultDestination*, Location,
                          std::optional<Shape> of_any_types = {});

  // LowerFilter.cpp
  Value lower_filter(const Builtin&, const Expressions&, Location, ResultDestination*);
  void lower_filter_create(const Expression& call);
  void lower_filter_fill(const Expressions&);
  std::optional<std::uint32_t> find_filter(std::string_view name) const;
  std::uint32_t require_filter(const Expression& name) const;
  std::uint32_t intern_filter(program::Filter);
  Value lower_gauss(const Builtin&, const Expressions&, Location, ResultDestination*);
  void lower_filter_set_element(const Expressions&);
  void lower_gabor(const Expressions&);
  void emit_filter_fill(std::uint32_t index, const std::function<double(double, double)>& weight);
  double real_constant(const Expression&, std::string_view subject, double high);
  program::Operand filter_operand(std::uint32_t index) const {
    return {program::OperandKind::kFilter, index};
  }

  // LowerData.cpp
  Value lower_random(const Builtin&, const Expressions&, Location, ResultDestination*);
  Value emit_to_either(program::Opcode, const std::vector<program::Operand>&, ResultDestination*);
  Value emit_random(program::Opcode, const Value& a, const Value& b, ResultDestination*);
  program::Operand group_operand(const Expression& class_name, bool of_variables);
  const std::string& class_name(const Expression&) const;
  Value lower_element_match(const Expressions&);
  program::Operand module_operand(const Expression&);
  void emit_plugin_arguments(const Expressions&, std::size_t first);
  Value lower_plugin(const Expressions&, ResultDestination*);
  void lower_plugin_statement(const Expression& call);
  void lower_colour_mapping(const Builtin&, const Expressions&);

  // LowerControlFlow.cpp
  void lower_conditional_jump(const Builtin&, const Expression& call);
  void lower_return(Location);
  Comparison lower_condition(const Expressions&, Location);
  Comparison lower_expression_condition(const Expression&);
  void emit_conditional_jump(const Comparison&, bool if_holds, ProgramBuilder::Label);
  void open_block(BlockKind, Location);
  void open_if(const Expressions&, Location);
  void open_while(const Expressions&, Location);
  void open_for(const Expressions&, Location);
  void check_for(const Value& from, const Value& bound, const Value& step, Location);
  Value loop_invariant(const Value&);
  void count_rounds(Block&, const Value& first);
  static Value borrowed(Value);
  Value compute_scalar(program::Opcode, const std::vector<Value>& operands);
  void jump_unless_fraction(const Block&, ProgramBuilder::Label);
  void advance_for(const Block&);
  void emit_for_test(const Block&);
  void open_repeat(const Expressions&, Location);
  void open_where(const Expressions&, Location);
  void lower_else(Location);
  void lower_elsewhere(Location);
  void close_block(BlockKind, Location);
  void close_loop(const Block&);
  Block& require_innermost_block(BlockKind, Location, std::string_view word);
  void emit_loop_exit(bool is_continue, Location);
  void define_label(const std::string&, Location);
  void emit_jump(program::Opcode, const Expression& label);
  ProgramBuilder::Label reference_label(const Expression&, bool call);
  void report_open_blocks(std::size_t min_depth);
  std::uint32_t current_where_region() const;

  // LowerHost.cpp
  void lower_actuate(const Builtin&, const Expression& call);
  void lower_print(const Builtin&, const Expressions&);
  void lower_boundary(const Expression&);
  void lower_slider(const Expressions&, Location);
  void lower_switch(const Expressions&, Location);
  void add_parameter(program::Parameter, Location);
  void lower_label(const Expressions&);
  void check_names(const Expressions&);
  void lower_tile(const Expressions&);
  Value lower_key(const Expressions&, ResultDestination*);

  Shape surface_;
  const syntax::SourceManager& sources_;
  syntax::Diagnostics& diagnostics_;
  const syntax::MacroTable& macros_;
  std::vector<std::string> other_names_;  // of macros and defines
  bool original_ = false;
  std::set<std::string> ignored_;             // calls that a warning named
  std::map<std::string, std::string> texts_;  // by the name that stands for them
  ProgramBuilder builder_;
  SymbolTable symbols_;
  std::set<std::string> written_names_;  // every name that some statement writes
  bool uses_mask_on_ = false, uses_where_ = false, uses_call_ = false;
  std::vector<Block> blocks_;
  std::map<std::uint32_t, MacroScope> scopes_;
  std::map<std::uint32_t, std::size_t> mask_bases_;  // of the registers that ignore masks: see MacroScope
  std::uint32_t skipped_expansion_ = 0;              // whose call has an error: its body is passed over
  std::span<const Statement> following_;             // the statements after the current one
  std::map<std::string, JumpTarget> labels_;
  std::vector<JumpSite> jumps_;
  std::vector<ScalarRead> scalar_reads_;
  std::uint32_t where_region_count_ = 0;
  std::map<std::uint32_t, std::uint32_t> machine_registers_;  // register to the file of its machine
  std::map<std::string, std::uint32_t> array_groups_;         // arrays that are indexed at run time
  std::map<std::string, std::uint32_t> group_indices_;        // classes that are indexed by number
  std::map<std::string, std::uint32_t> module_indices_;
  bool is_register_statement_ = false;  // the statement has registers: one random number per cell
  Shape shape_hint_;                    // for cell.x and the like, which have no shape of their own
};

}  // namespace apron::compiler
