// What the readers of `apron import` share: access to the tokens, calls and expressions, and the program
// being written. Internal to the import.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apron/run/import/ImportedKernels.h"
#include "apron/run/import/KernelTokens.h"

namespace apron::run {

using KernelTokenList = std::vector<KernelToken>;
using ProgramLines = std::vector<std::string>;

// The reason why a line cannot be translated.
struct Untranslatable {
  std::string reason;
};
template <class... Arguments>
[[noreturn]] void give_up(fmt::format_string<Arguments...> reason, Arguments&&... arguments) {
  throw Untranslatable{fmt::format(reason, std::forward<Arguments>(arguments)...)};
}

// True for a number, with or without a sign.
bool is_number(const KernelTokenList&);
// The texts of the tokens, joined.
std::string plain_text(const KernelTokenList&);

class KernelTranslation {
 protected:
  // Both arguments must outlive this.
  KernelTranslation(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : vocabulary_(vocabulary), options_(options) {}

  // ---- tokens from position_ on
  const KernelToken& peek(std::size_t offset = 0) const;
  bool at_end() const;
  bool consume(std::string_view symbol);
  // The position after the bracket that closes the one at `open`; the end of the text if it is not closed.
  std::size_t behind_bracket(std::size_t open) const;
  KernelTokenList tokens_between(std::size_t first, std::size_t last) const;
  // The arguments in the brackets at position_, which moves after the ')'.
  std::vector<KernelTokenList> parse_arguments();

  // ---- the program, and notes on lines that are missing in it
  void note(std::size_t line, std::string text);
  static void emit(ProgramLines& out, int depth, const std::string& text);
  // Copies the comment at position_.
  void emit_comment(ProgramLines& out, int depth);
  // Translates the call at position_ of an instruction, a function or the chip's interface, up to its ';'.
  // Throws Untranslatable.
  void translate_call(ProgramLines& out, int depth);
  // All throw Untranslatable. line: the line of notes; 0 for that of the token.
  std::string call_text(const std::string& name, const std::vector<KernelTokenList>& arguments,
                        std::size_t line, bool value);
  std::string expression(const KernelTokenList& tokens, std::size_t line = 0);
  // A name or number as the program writes it. A name without a value is reported, and becomes 0.
  std::string operand(const KernelToken& token, std::size_t line);
  // Ends the translation and returns the program.
  ImportedKernels finish();

  const KernelVocabulary& vocabulary_;
  const ImportOptions& options_;
  KernelTokenList tokens_;
  std::size_t position_ = 0;
  std::map<std::string, std::set<std::size_t>>
      functions_;  // that become macros, with their numbers of parameters
  std::map<std::string, std::vector<KernelTokenList>> defaults_;  // of the last parameters of a function
  std::set<std::string> parameters_;                              // of the current function
  std::set<std::string> arrays_;                                  // of the controller
  std::map<std::string, std::string> constants_;                  // the numbers that names had at first
  std::set<std::string> known_names_, called_;
  std::vector<std::pair<std::string, std::size_t>> uncalled_;
  ProgramLines defines_, macros_, main_;
  bool in_kernel_ = false, uses_frames_ = false, has_main_ = false;

 private:
  // A slider or switch of the host's window.
  bool translate_control(const std::string& name, const std::vector<KernelTokenList>& arguments);
  // DNEWS with several directions: RS, RW, RN and RE in every cell, then the OR of the neighbours.
  void translate_directions(ProgramLines& out, int depth, const std::vector<KernelTokenList>& arguments);
  std::string nested_call(const KernelTokenList& tokens, std::size_t& i);

  std::set<std::string> unset_;
  ProgramLines controls_, unset_lines_;
  std::vector<ImportNote> notes_;
  std::size_t instructions_ = 0;
};

}  // namespace apron::run
