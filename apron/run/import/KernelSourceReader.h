// Translates C++ programs for the SCAMP-5: kernels and the instructions around them, functions and scalars. A
// lexical translation: it knows the types of scalars and the names of registers, and names everything that it
// leaves out.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/import/KernelTranslation.h"

namespace apron::run {

class KernelSourceReader final : KernelTranslation {
 public:
  KernelSourceReader(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : KernelTranslation(vocabulary, options) {}

  ImportedKernels translate(std::string_view text);

 private:
  struct Function {
    std::string name;
    Signature signature;
    std::size_t body = 0, end = 0;  // positions of its '{' and after its '}'
    bool is_kernel = false, is_translated = false, has_instruction = false;
    bool deduces_result = false;  // returns auto, the type of its return statements
  };
  // A function-like macro of the preprocessor that stays.
  struct FunctionMacro {
    std::string name;
    std::vector<std::string> parameters;
    KernelTokenList body;
  };
  // A loop for (variable = first; …; …) with its last value.
  struct CountedLoop {
    std::string variable, first, last, stride;
    std::string repetitions;  // empty if the variable must be counted
    CppType type = CppType::kInt;
    CppRange range;
  };
  // The meaning of `continue` and `return` at a place.
  struct Loop {
    std::string continue_label;  // "" where APRON's own continue does it
    bool is_used = false;
    ValueFlow::Node node = 0;    // what decides how often it runs
    std::string left_out_break;  // why a `break` in it is left out
    std::string break_label;     // of a `switch`
  };

  // All of that name, in the order of the text.
  std::span<const Function> functions_of(const std::string& name) const;
  // Continues after the next ';' outside brackets, or at a '}' that closes the surrounding block.
  void skip_statement();
  std::optional<Function> function_at(std::size_t first) const;
  std::vector<Parameter> read_parameters(std::size_t open, std::size_t close) const;
  // A kernel object: scamp5_kernel name([]{ … });
  std::optional<Function> kernel_object_at(std::size_t i) const;
  std::optional<FunctionMacro> function_macro(const KernelToken& directive) const;
  // True if an instruction of the chip, or a function with one, is called between the positions.
  bool has_instruction(const KernelTokenList& tokens, std::size_t first, std::size_t last) const;
  // The same, or a register is an argument of a call.
  bool concerns_registers(std::size_t first, std::size_t last) const;
  // The functions and macros that become macros of the program.
  void collect_functions();
  // Removes the notes on functions that an expression below them needed after all.
  void forget_translated_functions();
  void collect(const Function&);
  bool require_function(const std::string& name, std::size_t count) override;
  void translate_function(Function& function);
  bool calls_itself(const Function& function) const;
  void declare_parameters(const Function&, ProgramLines& body);
  void add_macro(const std::string& pattern, const std::string& name, std::size_t line,
                 const ProgramLines& body);
  void translate_file();
  // A macro of the preprocessor: an object-like one becomes a define, a function-like one a macro.
  void translate_directive();
  void translate_function_macro(const FunctionMacro& macro, std::size_t line);
  void translate_enum();
  void translate_statement(ProgramLines& out, int depth);
  void leave_out(std::size_t start, const std::string& reason, ProgramLines& out, int depth);
  void leave_out_values(std::size_t first, std::size_t last, ProgramLines& out, int depth);
  void dispatch_statement(ProgramLines& out, int depth);
  void translate_block(ProgramLines& out, int depth);
  std::size_t statement_end(std::size_t first) const;
  bool is_declaration() const;
  void translate_declaration(ProgramLines& out, int depth);
  struct Qualifiers {
    bool is_const, is_static, is_reference;
  };
  void translate_declarator(CppType type, Qualifiers qualifiers, std::size_t end, ProgramLines& out,
                            int depth);
  void translate_expression(ProgramLines& out, int depth);
  std::size_t argument_end(std::size_t first, std::size_t end) const;
  void translate_body(ProgramLines& out, int depth);
  void translate_for(ProgramLines& out, int depth);
  // Nothing for a loop of another form.
  std::optional<CountedLoop> counted_loop(const KernelTokenList& header, std::size_t body,
                                          std::size_t body_end);
  void translate_other_for(const KernelTokenList& header, std::size_t open, ProgramLines& out, int depth);
  // True if statements between the positions may write the variable.
  bool may_change(const std::string& name, std::size_t first, std::size_t last) const;
  bool may_change(const std::string& name, std::size_t first, std::size_t last,
                  std::set<std::size_t>& visited) const;
  std::vector<bool> changed_brackets(std::size_t first, std::size_t last) const;
  bool may_change_any(const KernelTokenList& names, std::size_t first, std::size_t last) const;
  // The loop over the frames, which has no end on the chip.
  void translate_frames(ProgramLines& out, int depth);
  bool leaves_itself(std::size_t body) const;
  bool takes_frame(std::size_t word) const;
  bool takes_frame(std::size_t word, std::set<std::size_t>& visited) const;
  void translate_switch(ProgramLines& out, int depth);
  // `break` and `continue`.
  void translate_leaving(ProgramLines& out, int depth);
  void translate_while(ProgramLines& out, int depth);
  void translate_do(ProgramLines& out, int depth);
  void translate_if(ProgramLines& out, int depth);
  void translate_return(ProgramLines& out, int depth);
  // The condition in front of a loop's body; the statements that leave the loop if they are needed.
  void emit_leave_unless(const KernelTokenList& condition, ProgramLines& out, int depth);
  std::string label(const std::string& stem);
  // Returns the loop as it was left.
  Loop loop_body(ProgramLines& out, int depth, std::string continue_label, bool is_endless = false);

  std::map<std::string, std::vector<Function>> all_functions_;  // by their names
  bool has_references_ = false;                                 // among their parameters
  std::vector<Loop> loops_;
  // Tokens [first, second) of the last loop examined that contains no `break` and no `return`.
  mutable std::pair<std::size_t, std::size_t> staying_;
  const Function* current_ = nullptr;
  bool returns_early_ = false;
  CppType result_ = CppType::kVoid;  // of the current function; of auto from its first return statement on
  bool is_in_definition_ = false;    // tokens_ are those of a macro of the preprocessor
  int labels_ = 0;
  std::size_t statement_depth_ = 0;
};

}  // namespace apron::run
