// Yields the statements of a program line by line, with includes, conditions, defines and macro bodies
// processed. The parser recognises macro calls and opens them here with enter().
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/FileReader.h"
#include "apron/syntax/MacroTable.h"
#include "apron/syntax/SourceManager.h"
#include "apron/syntax/Token.h"
#include "apron/syntax/Writes.h"

namespace apron::syntax {

// Limits, named in the error when hit.
inline constexpr std::size_t kMaxIncludeDepth = 32;
inline constexpr std::size_t kMaxIncludes = 1000;
inline constexpr std::size_t kMaxMacroDepth = 64;
inline constexpr int kMaxLoopDepth = 64;             // of `!for`
inline constexpr std::size_t kMaxParameters = 1000;  // of a macro or function
inline constexpr std::size_t kMaxExpansions = 100'000;
inline constexpr std::size_t kMaxLines = 1'000'000;  // after expansion
inline constexpr std::size_t kMaxLineTokens = 20'000;

// The constants that every program has: the surface's size in cells.
inline constexpr std::string_view kWidthName = "SURFACE_WIDTH", kHeightName = "SURFACE_HEIGHT";

// The sources and the target of a compilation.
struct SourceOptions {
  std::string file = {};
  // The surface in cells: SURFACE_WIDTH and SURFACE_HEIGHT, and the default shape of registers.
  std::uint32_t width = 0, height = 0;
  std::vector<std::string> include_paths = {};  // for !include, searched after the including file's directory
  std::string library_path = {};                // the installed library, searched last; "" for none
  std::string prelude = {};                     // a file included before the first line; "" for none
};

struct PreprocessorOptions : SourceOptions {
  // True if there is an instruction of that name, which a macro of the same name calls in its body.
  std::function<bool(std::string_view)> is_builtin = {};
  // The number of the argument that a statement of that instruction writes, or -1.
  std::function<int(std::string_view name, std::size_t arguments)> written_argument = {};
  // "" if the palette exists, otherwise the error message.
  std::function<std::string(std::string_view)> check_palette = {};
};

// A declaration by `!register`, `!scalar`, `!machine_register`, `!create` or `!object`.
struct Declaration {
  enum class Kind : std::uint8_t { kRegister, kElement, kClass };
  Kind kind = Kind::kRegister;
  Location location;
  std::string name;         // of the register or element; of the class
  std::string class_name;   // of an element
  std::string alias;        // of a class
  std::uint32_t count = 0;  // of the elements of an array; 0: it is none
  std::uint32_t owner = 0;  // of a function's local register: the number of its expansion
  bool of_variables = false;
  bool is_machine_register = false;     // only lines of the declaring file compute with it
  std::uint32_t width = 0, height = 0;  // cells
  std::string cell_type;                // of a register: "int32" and the like; "": float
  std::string palette;                  // `!default_palette` in force; "" for none
  float scale = 0.0F;
};

// The requirement of a macro's pattern on an operand: `!operand_kind(name, 'description', names…)`.
struct OperandKind {
  std::string description;      // "an analogue register (A to F)"
  std::set<std::string> names;  // the operands of that kind; empty: all that are names of no other kind
};

struct PreprocessedItem {
  enum class Kind : std::uint8_t { kLine, kDeclaration, kMacroEnd, kEndOfInput };
  Kind kind = Kind::kEndOfInput;
  Line line;
  Declaration declaration;
  std::uint32_t expansion = 0;  // whose body ended
};

class Preprocessor {
 public:
  Preprocessor(PreprocessorOptions, FileReader&, SourceManager&, Diagnostics&);

  // The next item; kEndOfInput once all files and macros above `min_depth` (see depth()) are read.
  PreprocessedItem next(std::size_t min_depth = 0);
  std::size_t depth() const noexcept { return frames_.size(); }
  // True if a limit, which is reported, has ended the program before its last line.
  bool is_aborted() const noexcept { return is_aborted_; }

  // The macro that a call means here: none while it is being expanded itself and the language has an
  // instruction of that name.
  MacroTable::Handle find_macro(const std::string& name, std::size_t arguments, bool has_result) const;
  // True in the body of a macro that was defined before the last `!operator(=, …)`, which leaves its lines
  // alone.
  bool assigns_plainly() const;
  bool is_expanding(const MacroTable::Handle&) const;
  // The end of a message on a limit of depth, for a function that calls itself: ": …"; "" if none does.
  std::string endless_function() const;
  const MacroTable& macros() const noexcept { return macros_; }
  // "!include" and the like.
  static std::vector<std::string> directive_names();
  bool is_builtin(std::string_view name) const { return options_.is_builtin && options_.is_builtin(name); }

  // Continues with the macro's body, whose parameters are replaced by the tokens. Returns false if a limit is
  // hit, which is reported and ends the program.
  bool enter_macro(const MacroTable::Handle&, std::uint32_t expansion, std::vector<Tokens> results,
                   std::vector<Tokens> arguments);

  // "" if the tokens are an operand of the kind, otherwise the error message: "must be …, not …".
  std::string check_operand(const std::string& kind, const Tokens& operand) const;
  // One of the kind's operands; "" if it has no names.
  std::string operand_of_kind(const std::string& kind, std::size_t number) const;
  // The instruction or macro to which `!operator` bound the symbol, or "".
  std::string operator_target(const std::string& symbol) const;
  // The name of the last `!module`, or "". In a macro's body, the last one before the macro's definition.
  const std::string& module() const noexcept { return module_; }
  // Every `!module`, in the order of the text.
  struct NamedModule {
    std::string name;
    Location location;
  };
  const std::vector<NamedModule>& modules() const noexcept { return modules_; }
  std::size_t max_addr() const noexcept { return max_addr_; }
  // True after `!compatibility('original')`.
  bool is_original() const noexcept { return original_; }
  // The number, as it is written, that a define makes of the name; "" if there is none.
  std::string constant_of(const std::string& name) const;
  // Every define, for suggestions.
  std::vector<std::string> define_names() const;

 private:
  struct ConditionalBlock {
    Location location;
    bool enclosing_active = true;  // the lines around it are read
    bool is_active = true;
    bool branch_taken = true;
    bool has_else = false;
  };
  struct InputFrame {
    std::shared_ptr<const std::vector<Line>> lines;
    std::size_t next_line = 0;
    std::string path;  // of a file
    MacroTable::Handle macro;
    std::uint32_t expansion = 0;
    std::map<std::string, Tokens> parameters;
    std::vector<ConditionalBlock> conditionals;
    // The variable of a `!for` while its lines repeat.
    std::string loop_variable;
    double loop_value = 0.0, loop_end = 0.0, loop_step = 1.0;
  };

  template <class... Arguments>
  void report(Location location, fmt::format_string<Arguments...> message, Arguments&&... arguments) {
    diagnostics_.error(location, fmt::format(message, std::forward<Arguments>(arguments)...));
  }
  void abort_input();
  bool is_active() const;
  void pop_frame(PreprocessedItem&);
  bool process_line(PreprocessedItem&);
  void close_bracket(Line&);
  bool writes_constant(const Tokens&);
  static bool repeat_loop(InputFrame&);
  void substitute(Tokens&, const InputFrame&) const;
  bool substitute(const Token&, const InputFrame&, Tokens& out) const;
  void join_words(Line&);
  bool expand_defines(Tokens&);
  bool expand_defines(const Tokens&, Tokens& out, std::set<std::string>& hide_set, int depth);

  // Functions.cpp
  void handle_function(const Tokens&);
  bool parse_function_signature(const Tokens&, Macro&);
  static bool parse_function_parameter(const Tokens&, MacroParameter&);
  bool read_function_body(Location, std::vector<Line>&);
  void define_function(Macro);
  struct FunctionWrites {
    std::set<std::string> names;     // written as a whole, or declared
    std::set<std::string> elements;  // arrays that the function does not declare, of which it writes elements
    std::set<std::string> unknown;   // given to calls of what is not defined so far
    std::set<std::string> labels;
  };
  FunctionWrites writes_of_function(const Macro&);
  const BodyWrites& writes_of(const MacroTable::Handle&);
  WriteKind write_kind(const BodyWrites::Call&, std::size_t argument, const Macro* caller);

  // Directives.cpp
  using Arguments = std::vector<Tokens>;
  struct Directive;
  static std::span<const Directive> directives();
  void handle_directive(Line&);
  void ignore_directive(const Tokens&);
  void handle_stray_macro_line(const Tokens&);
  bool handle_conditional(const Tokens&);
  void handle_if(const Tokens&);
  bool evaluate_condition(const Tokens&);
  bool parse_arguments(const Tokens&, std::size_t min_count, std::size_t max_count, Arguments&);
  bool parse_string_argument(const Tokens&, std::string& text, std::string_view subject);
  void handle_include(const Tokens&);
  void push_file(const std::string& path, std::string text, Location from);
  void handle_define(const Tokens&);
  void handle_macro_def(const Tokens&);
  bool may_write_program(const std::vector<Line>& body) const;
  bool writes_program(const Macro&);
  void add_macro(Macro);
  void handle_for(const Tokens&);
  bool parse_macro_signature(const Tokens&, Macro&);
  void handle_operand_kind(const Tokens&);
  const OperandKind* find_operand_kind(const std::string& operand) const;
  bool parse_macro_body(Macro&, Location location);
  Declaration make_declaration(Declaration::Kind, Location) const;
  void handle_register(const Tokens&);
  void handle_error(const Tokens&);
  void handle_create(const Tokens&);
  void handle_object(const Tokens&);
  bool is_in_function() const;
  bool parse_array_size(Tokens, std::uint32_t& count);
  bool parse_size_argument(const Tokens&, Location location, std::uint32_t& size);
  void handle_operator(const Tokens&);
  void handle_max_addr(const Tokens&);
  void handle_default_palette(const Tokens&);
  void handle_module(const Tokens&);
  void handle_compatibility(const Tokens&);
  void include_file(const std::string& name, Location directive, Location argument);

  PreprocessorOptions options_;
  FileReader& reader_;
  SourceManager& sources_;
  Diagnostics& diagnostics_;
  std::vector<InputFrame> frames_;
  std::vector<Declaration> pending_declarations_;  // of a directive, returned one by one from the back
  std::map<std::string, Tokens> defines_;
  std::map<std::string, std::string> operators_;
  std::map<std::string, OperandKind> operand_kinds_;
  MacroTable macros_;
  std::set<std::string> writing_macros_;  // whose bodies write a name of the program or may run a routine
  std::map<MacroTable::Handle, BodyWrites> body_writes_;
  std::string module_;
  std::vector<NamedModule> modules_;
  std::vector<MacroTable::Handle> assigning_plainly_;  // defined before the last `!operator(=, …)`
  bool original_ = false;
  std::string palette_;
  float scale_ = 0.0F;
  std::size_t include_count_ = 0;
  std::size_t line_count_ = 0;
  std::size_t max_addr_ = SIZE_MAX;
  bool is_aborted_ = false;
};

// The key of a define of an indexed name: "name[index]".
std::string indexed_name(const Token& name, const Token& index);

}  // namespace apron::syntax
