// Translates kernels in the C++ of the chip's public tutorials. Functions become macros, and loops and
// conditions those of APRON.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apron/run/import/KernelTranslation.h"

namespace apron::run {

class KernelSourceReader final : KernelTranslation {
 public:
  KernelSourceReader(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : KernelTranslation(vocabulary, options) {}

  ImportedKernels translate(KernelTokenList tokens);

 private:
  struct Function {
    std::string name;
    std::vector<std::string> parameters;
    std::size_t body = 0, end = 0;          // positions of its '{' and after its '}'
    std::vector<KernelTokenList> defaults;  // of the last parameters
  };
  // A function-like macro of the preprocessor.
  struct FunctionMacro {
    std::string name;
    std::vector<std::string> parameters;
    KernelTokenList words;  // of the definition
    std::size_t body = 0;   // position after its ')'
  };
  // A loop for (variable = first; …; …) with its last value.
  struct CountedLoop {
    std::string variable, first, last, stride;
    std::string repetitions;  // empty if the variable must be counted
  };

  // Continues after the next ';' outside brackets, or at a '}' that closes the surrounding block.
  void skip_statement();
  std::optional<Function> function_at(std::size_t first) const;
  // A kernel object: scamp5_kernel name([]{ … });
  std::optional<Function> kernel_object_at(std::size_t i) const;
  std::optional<FunctionMacro> function_macro(const KernelToken& directive) const;
  // True if an instruction of the chip, or a function with one, is called between the positions.
  bool has_instruction(const KernelTokenList& tokens, std::size_t first, std::size_t last) const;
  // The functions and macros that become macros of the program.
  void collect_functions();
  void translate_function(const Function& function, bool is_kernel);
  void add_macro(const std::string& name, const std::vector<std::string>& parameters,
                 const ProgramLines& body, std::size_t line);
  void translate_file();
  // A macro of the preprocessor: an object-like one becomes a define, a function-like one a macro.
  void translate_directive();
  void translate_function_macro(const FunctionMacro& macro, std::size_t line);
  void translate_statement(ProgramLines& out, int depth);
  void dispatch_statement(ProgramLines& out, int depth);
  std::size_t statement_end(std::size_t first) const;
  void translate_declaration(ProgramLines& out, int depth);
  void translate_assignment(ProgramLines& out, int depth, std::size_t end);
  std::size_t argument_end(std::size_t first, std::size_t end) const;
  void translate_body(ProgramLines& out, int depth);
  void translate_for(ProgramLines& out, int depth);
  // Throws Untranslatable for a loop of another form.
  CountedLoop counted_loop(const KernelTokenList& header);
  // The loop over the frames, which has no end on the chip.
  void translate_frames(ProgramLines& out, int depth);
  void translate_while(ProgramLines& out, int depth);
  void translate_if(ProgramLines& out, int depth);

  bool in_macro_ = false;
};

}  // namespace apron::run
