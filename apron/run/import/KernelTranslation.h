// The state that the readers of `apron import` share: access to the tokens, the names in scope, calls and
// expressions, and the program being written. Internal to the import.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apron/run/import/CppTypes.h"
#include "apron/run/import/ImportedKernels.h"
#include "apron/run/import/KernelPreprocessor.h"
#include "apron/run/import/KernelTokens.h"
#include "apron/run/import/ValueFlow.h"

namespace apron::run {

using ProgramLines = std::vector<std::string>;

// The reason why a line cannot be translated.
struct Untranslatable {
  std::string reason;
};
template <class... Arguments>
[[noreturn]] void give_up(fmt::format_string<Arguments...> reason, Arguments&&... arguments) {
  throw Untranslatable{fmt::format(reason, std::forward<Arguments>(arguments)...)};
}

// Counts how deeply something is nested, and gives up what is too deep for the stack.
class Nesting {
 public:
  Nesting(std::size_t& depth, const char* what) : depth_(depth) {
    if (depth_ >= kMax) give_up("{} is nested too deeply", what);
    ++depth_;
  }
  ~Nesting() { --depth_; }
  Nesting(const Nesting&) = delete;
  Nesting& operator=(const Nesting&) = delete;

 private:
  static constexpr std::size_t kMax = 400;
  std::size_t& depth_;
};

// True for a number, with or without a sign.
bool is_number(const KernelTokenList&);
// The texts of the tokens, joined.
std::string plain_text(const KernelTokenList&);

class KernelTranslation {
 protected:
  // The meaning of a name of the C++ text.
  struct Variable {
    std::string text;  // in the program
    CppType type = CppType::kInt;
    CppRange range = range_of(CppType::kInt);
    std::optional<double> constant;  // of a const
    bool is_const = false;
    ValueFlow::Node node = 0;
  };
  struct Parameter {
    std::string name;
    CppType type = CppType::kOther;
    bool is_reference = false;               // a scalar that the function may write
    bool is_any = false;                     // of a macro of the preprocessor: any operand
    std::optional<KernelTokenList> initial;  // its default argument
    ValueFlow::Node node = 0;
  };
  struct Signature {
    std::string name;  // in the program
    std::vector<Parameter> parameters;
    CppType result = CppType::kVoid;
    ValueFlow::Node call = 0, value = 0;  // that it runs, and its result
    bool accepts(std::size_t count) const {
      return count <= parameters.size() && (count == parameters.size() || parameters[count].initial);
    }
  };
  using Scope = std::map<std::string, Variable>;

  // Both arguments must outlive this.
  KernelTranslation(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : vocabulary_(vocabulary), options_(options), scopes_(1) {}
  virtual ~KernelTranslation() = default;

  // ---- tokens from position_ on
  const KernelToken& peek(std::size_t offset = 0) const;
  bool at_end() const;
  bool consume(std::string_view symbol);
  std::size_t behind_bracket(std::size_t open) const { return run::behind_bracket(tokens_, open); }
  KernelTokenList tokens_between(std::size_t first, std::size_t last) const;
  // The arguments in the brackets at position_, which moves after the ')'.
  std::vector<KernelTokenList> parse_arguments();

  // ---- the program, and notes on lines that are missing in it
  void note(std::size_t line, std::string text, Severity severity = Severity::kNote);
  void emit(ProgramLines& out, int depth, const std::string& text);
  // Copies the comment at position_.
  void emit_comment(ProgramLines& out, int depth);
  // Translates the call at position_ of an instruction, a function or the chip's interface, up to its ';'.
  // Throws Untranslatable.
  void translate_call(ProgramLines& out, int depth);

  // ---- names
  Variable* find_variable(const std::string& name);
  // Declares a variable in the innermost scope, under a name that means nothing else in the program.
  Variable& declare(const std::string& name, CppType type);
  bool is_register(const std::string& name) const;
  // True if it was read before, or without, a declaration.
  bool is_unset(const std::string& name) const { return unset_.contains(name); }
  // A name that is new in the program.
  std::string new_name(const std::string& stem);
  // The type that begins at i, which moves behind it; kVoid with no tokens read if there is none.
  static std::optional<CppType> read_type(const KernelTokenList& tokens, std::size_t& i,
                                          bool* is_const = nullptr);

  // ---- expressions; all throw Untranslatable. Statements that an expression needs first are written to
  // `out`.
  CppValue expression(const KernelTokenList& tokens, ProgramLines& out, int depth);
  // True if the expression needs no statements and contains no call, so that it may be evaluated again.
  std::optional<CppValue> plain_expression(const KernelTokenList& tokens);
  // In a variable of its own if it is a call.
  CppValue settle(CppValue value);
  CppValue settle(CppValue value, ProgramLines& out, int depth);
  CppValue call_value(const std::string& name, const std::vector<KernelTokenList>& arguments,
                      std::size_t line);
  void call_statement(const std::string& name, const std::vector<KernelTokenList>& arguments,
                      std::size_t line, ProgramLines& out, int depth);
  // Makes a function that only computes available to the program; false if there is none of that name.
  virtual bool require_function(const std::string&, std::size_t) { return false; }
  const Signature* find_function(const std::string& name, std::size_t count) const;
  // True if the expression adds a slider or switch; the name is then its handle.
  bool add_control(const std::string& handle, const KernelTokenList& expression);

  // Ends the translation and returns the program.
  ImportedKernels finish();

  const KernelVocabulary& vocabulary_;
  const ImportOptions& options_;
  KernelTokenList tokens_;
  std::size_t position_ = 0;
  std::vector<std::string> files_{""};
  std::multimap<std::string, Signature> functions_;  // that become macros
  std::vector<Scope> scopes_;                        // the first is that of the file
  std::map<std::string, std::string> constants_;     // the numbers that names had at first
  std::set<std::string> called_;
  std::vector<std::pair<std::string, std::size_t>> uncalled_;
  ProgramLines defines_, statics_, macros_, main_;
  mutable ValueFlow flow_;
  ValueFlow::Place place_;  // of the statement
  std::vector<ImportNote> notes_;
  bool in_kernel_ = false, in_macro_ = false, uses_frames_ = false, has_main_ = false;

 private:
  struct Cursor;
  // While it lives, names are those of the file, if it is asked to.
  class FileScope {
   public:
    FileScope(KernelTranslation& translation, bool is_active)
        : translation_(translation), is_active_(is_active) {
      if (is_active_) outer_ = std::exchange(translation_.scopes_, {translation_.scopes_.front()});
    }
    ~FileScope() {
      if (!is_active_) return;
      outer_.front() = std::move(translation_.scopes_.front());
      translation_.scopes_ = std::move(outer_);
    }
    FileScope(const FileScope&) = delete;
    FileScope& operator=(const FileScope&) = delete;

   private:
    KernelTranslation& translation_;
    bool is_active_;
    std::vector<Scope> outer_;
  };
  CppValue parse_assignment(Cursor&);
  CppValue parse_conditional(Cursor&);
  CppValue parse_binary(Cursor&, int least);
  CppValue parse_logical(Cursor&, CppValue left, const std::string& op, int level);
  CppValue parse_unary(Cursor&);
  CppValue parse_primary(Cursor&);
  CppValue parse_name(Cursor&);
  CppValue parse_cast(Cursor&, CppType);
  // A value in a variable that no text of the kernel names.
  CppValue store_new(CppValue value);
  // Runs with the lines and depth as those of the statements that expressions need first.
  template <class Action>
  void with_prelude(ProgramLines& out, int depth, const Action& action);
  // Parses in lines of their own, which are returned.
  template <class Parse>
  ProgramLines separate(const Parse& parse);
  std::string join_arguments(const std::string& name, const std::vector<KernelTokenList>& arguments,
                             bool value, CppType& result);
  std::string function_arguments(const Signature&, const std::vector<KernelTokenList>& arguments);
  std::string argument(const std::string& function, std::size_t index, const KernelTokenList& tokens);
  std::string register_argument(const KernelTokenList& tokens);

  // A slider or switch of the host's window, which sets a variable or has a handle.
  bool translate_control(const std::string& name, const std::vector<KernelTokenList>& arguments,
                         const std::string& handle = "");
  // The value of the slider or switch that has the handle; std::nullopt if there is none.
  std::optional<CppValue> control_value(const std::string& handle);
  // DNEWS with several directions: RS, RW, RN and RE in every cell, then the OR of the neighbours.
  void translate_directions(ProgramLines& out, int depth, const std::vector<KernelTokenList>& arguments);
  // Names an operand that a transfer of the chip connects once, although it stands there twice.
  void note_shared_operands(const std::string& name, const std::vector<KernelTokenList>& arguments,
                            std::size_t line);

  std::set<std::string> unset_, names_;
  std::map<std::string, int> suffixes_;         // those up to it are taken, of names that begin so
  std::map<std::string, std::string> handles_;  // of sliders and switches: the texts that read them
  ProgramLines controls_, unset_lines_;
  ProgramLines* prelude_ = nullptr;
  int prelude_depth_ = 0;
  std::size_t instructions_ = 0;
  std::size_t depth_ = 0;
};

}  // namespace apron::run
