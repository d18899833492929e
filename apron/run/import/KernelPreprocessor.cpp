#include "apron/run/import/KernelPreprocessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "apron/run/import/CppTypes.h"

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

constexpr std::size_t kMaxDepth = 100;
constexpr std::size_t kMaxExpanded = 300'000;  // tokens of macros, in all expansions
constexpr std::size_t kMaxTokens = 1'000'000;

// The value of the condition of an #if, whose macros are expanded: unknown names are 0.
class ConditionParser {
 public:
  explicit ConditionParser(const KernelTokenList& tokens) : tokens_(tokens) {}
  double value() { return conditional(); }
  bool is_too_deep() const { return is_too_deep_; }

 private:
  const KernelToken& peek() const {
    static const KernelToken kEnd;
    return i_ < tokens_.size() ? tokens_[i_] : kEnd;
  }
  // The value of parse(), or 0 of what is nested too deeply for the stack.
  template <class Parse>
  double nested(const Parse& parse) {
    constexpr int kMaxNesting = 200;
    if (depth_ == kMaxNesting) {
      is_too_deep_ = true;
      return 0.0;
    }
    ++depth_;
    const double value = parse();
    --depth_;
    return value;
  }
  double conditional() {
    return nested([this] {
      const double test = binary(0);
      if (!peek().is("?")) return test;
      ++i_;
      const double yes = conditional();
      if (peek().is(":")) ++i_;
      const double no = conditional();
      return test != 0.0 ? yes : no;
    });
  }
  double binary(int least) {
    double left = unary();
    for (;;) {
      const auto [op, level] = binary_operator(peek());
      if (level < least) return left;
      ++i_;
      const auto result =
          cpp_binary(cpp_constant(left, CppType::kInt), op, cpp_constant(binary(level + 1), CppType::kInt));
      left = result && result->constant ? *result->constant : 0.0;
    }
  }
  double unary() {
    return nested([this] {
      const KernelToken token = peek();
      if (i_ < tokens_.size()) ++i_;
      if (token.is("!")) return unary() == 0.0 ? 1.0 : 0.0;
      if (token.is("+")) return unary();
      if (token.is("-")) return -unary();
      if (token.is("~")) return -unary() - 1.0;
      if (token.is("(")) {
        const double value = conditional();
        if (peek().is(")")) ++i_;
        return value;
      }
      if (token.kind == Kind::kNumber) return std::strtod(token.text.c_str(), nullptr);
      return token.is_name("true") ? 1.0 : 0.0;
    });
  }

  const KernelTokenList& tokens_;
  std::size_t i_ = 0;
  int depth_ = 0;
  bool is_too_deep_ = false;
};

// The word that `##` makes of two.
KernelToken pasted(KernelToken left, const KernelToken& right) {
  const auto spelling = [](const KernelToken& token) {
    return token.spelling.empty() ? token.text : token.spelling;
  };
  const std::string text = spelling(left) + spelling(right);
  const KernelTokenList words = scan_kernel_source(text, left.line, left.file);
  if (words.size() == 2 && words[0].kind != Kind::kComment) return words[0];
  left.text = text;
  return left;
}

}  // namespace

std::vector<KernelTokenList> split_arguments(const KernelTokenList& tokens, std::size_t first,
                                             std::size_t last) {
  std::vector<KernelTokenList> arguments(1);
  int depth = 0;
  for (std::size_t i = first; i < last; ++i) {
    const KernelToken& token = tokens[i];
    if (token.kind == Kind::kComment) continue;
    if (token.opens_bracket()) ++depth;
    if (token.closes_bracket()) --depth;
    if (depth == 0 && token.is(","))
      arguments.emplace_back();
    else
      arguments.back().push_back(token);
  }
  if (arguments.size() == 1 && arguments[0].empty()) arguments.clear();
  return arguments;
}

std::size_t behind_bracket(const KernelTokenList& tokens, std::size_t open) {
  int depth = 0;
  for (std::size_t i = open; i < tokens.size(); ++i) {
    if (tokens[i].opens_bracket()) ++depth;
    if (tokens[i].closes_bracket() && --depth == 0) return i + 1;
  }
  return tokens.empty() ? 0 : tokens.size() - 1;
}

KernelTokenList KernelPreprocessor::run(std::string_view text) {
  files_ = {""};
  macros_["__cplusplus"].body = {{Kind::kNumber, "202002"}};
  read(text, 0, "");
  if (is_too_deep_ || refuse_depth(out_)) out_.clear();
  out_.push_back({Kind::kEnd, "", out_.empty() ? 1 : out_.back().line, 0});
  return std::move(out_);
}

void KernelPreprocessor::read(std::string_view text, std::size_t file, const std::string& folder) {
  const KernelTokenList tokens = scan_kernel_source(text, 1, file);
  if (refuse_depth(tokens)) return;
  for (std::size_t i = 0; tokens[i].kind != Kind::kEnd;) {
    if (tokens[i].kind == Kind::kDirective) {
      directive(tokens[i++], folder);
    } else if (!is_active()) {
      ++i;
    } else if (out_.size() > kMaxTokens) {
      return refuse(tokens[i], fmt::format("the kernel has more than {} words", kMaxTokens));
    } else {
      expand(tokens, i, {}, out_);
    }
  }
}

bool KernelPreprocessor::is_active() const { return branches_.empty() || branches_.back().is_active; }

void KernelPreprocessor::directive(const KernelToken& token, const std::string& folder) {
  const std::string& text = token.text;
  const std::size_t end = std::min(text.find_first_not_of("abcdefghijklmnopqrstuvwxyz"), text.size());
  const std::string word = text.substr(0, end), rest = text.substr(end);
  if (word == "if" || word == "ifdef" || word == "ifndef") {
    const bool outer = is_active();
    bool holds = false;
    if (outer && word == "if") holds = condition(token, rest);
    if (outer && word != "if") {
      const KernelTokenList names = scan_kernel_source(rest);
      holds = macros_.contains(names[0].text) == (word == "ifdef");
    }
    branches_.push_back({outer && holds, holds, outer});
  } else if ((word == "elif" || word == "else") && !branches_.empty()) {
    Branch& branch = branches_.back();
    branch.is_active = branch.is_enclosed && !branch.was_taken && (word == "else" || condition(token, rest));
    branch.was_taken = branch.was_taken || branch.is_active;
  } else if (word == "endif" && !branches_.empty()) {
    branches_.pop_back();
  } else if (!is_active()) {
    return;
  } else if (word == "include") {
    include(token, folder);
  } else if (word == "define") {
    define(token);
  } else if (word == "undef") {
    macros_.erase(scan_kernel_source(rest)[0].text);
  } else if (word == "error") {
    notes_.push_back({.line = token.line,
                      .text = "#error" + rest,
                      .severity = Severity::kError,
                      .file = files_[token.file]});
  }
}

void KernelPreprocessor::include(const KernelToken& token, const std::string& folder) {
  const std::size_t open = token.text.find('"');
  if (open == std::string::npos) return;  // the system's and the chip's own headers
  const std::string name = token.text.substr(open + 1, token.text.find('"', open + 1) - open - 1);
  const std::string path = folder + name;
  if (included_.contains(path)) return;
  if (files_.size() > kMaxDepth)
    return refuse(token, fmt::format("more than {} files are included", kMaxDepth));
  const auto text = options_.read_include ? options_.read_include(path) : std::nullopt;
  if (!text) {
    notes_.push_back({.line = token.line,
                      .text = fmt::format("the included file '{}' is not there", name),
                      .file = files_[token.file]});
    return;
  }
  included_.insert(path);
  files_.push_back(path);
  const std::vector<Branch> outer = std::exchange(branches_, {});
  const std::size_t slash = path.rfind('/');
  read(*text, files_.size() - 1, slash == std::string::npos ? "" : path.substr(0, slash + 1));
  branches_ = outer;
}

// A limit that the kernel exceeds, once.
void KernelPreprocessor::refuse(const KernelToken& at, std::string reason) {
  if (std::ranges::find(notes_, reason, &ImportNote::text) == notes_.end())
    notes_.push_back(
        {.line = at.line, .text = std::move(reason), .severity = Severity::kError, .file = files_[at.file]});
}

bool KernelPreprocessor::refuse_depth(const KernelTokenList& tokens) {
  const KernelToken* const deep = find_too_deep(tokens);
  if (deep == nullptr) return false;
  refuse(*deep, fmt::format("brackets are nested more than {} deep", kMaxBrackets));
  is_too_deep_ = true;
  return true;
}

bool KernelPreprocessor::condition(const KernelToken& token, std::string_view expression) {
  KernelTokenList tokens;
  const KernelTokenList words = scan_kernel_source(expression, token.line, token.file);
  for (std::size_t i = 0; words[i].kind != Kind::kEnd; ++i) {
    if (words[i].kind == Kind::kComment) continue;
    if (!words[i].is_name("defined")) {
      tokens.push_back(words[i]);
      continue;
    }
    const bool in_brackets = words[i + 1].is("(");
    i += in_brackets ? 2 : 1;
    if (words[i].kind == Kind::kEnd) break;
    tokens.push_back({Kind::kNumber, macros_.contains(words[i].text) ? "1" : "0", token.line, token.file});
    if (in_brackets && words[i + 1].is(")")) ++i;
  }
  const KernelTokenList values = without_names(expand_all(tokens, {}));
  ConditionParser parser(values);
  const bool holds = parser.value() != 0.0;
  if (parser.is_too_deep()) refuse(token, "the condition is nested too deeply");
  return holds;
}

// Constants that the program keeps as names become numbers.
KernelTokenList KernelPreprocessor::without_names(const KernelTokenList& in) const {
  KernelTokenList out;
  for (const KernelToken& word : in) {
    const auto macro = macros_.find(word.text);
    if (word.kind == Kind::kName && macro != macros_.end() && macro->second.is_kept &&
        !macro->second.is_function)
      out.insert(out.end(), macro->second.body.begin(), macro->second.body.end());
    else
      out.push_back(word);
  }
  return out;
}

// True if the macro, or one that it uses, makes new words.
bool KernelPreprocessor::makes_words(const Macro& macro) const {
  Names visited;
  const auto search = [&](const auto& self, const Macro& one) -> bool {
    return std::ranges::any_of(one.body, [&](const KernelToken& word) {
      if (word.is("##") || word.is("#")) return true;
      const auto inner = macros_.find(word.text);
      return word.kind == Kind::kName && inner != macros_.end() && visited.insert(word.text).second &&
             self(self, inner->second);
    });
  };
  return search(search, macro);
}

void KernelPreprocessor::define(const KernelToken& token) {
  KernelTokenList words = scan_kernel_source(std::string_view(token.text).substr(6), token.line, token.file);
  std::erase_if(words, [](const KernelToken& word) { return word.kind == Kind::kComment; });
  words.pop_back();
  if (words.empty() || words[0].kind != Kind::kName) return;
  const std::string name = words[0].text;
  Macro macro;
  std::size_t body = 1;
  // With a blank before it, the bracket belongs to the value.
  macro.is_function = token.text.substr(token.text.find(name, 6) + name.size()).starts_with('(');
  if (macro.is_function) {
    for (body = 2; body < words.size() && !words[body].is(")"); ++body)
      if (words[body].kind == Kind::kName) macro.parameters.push_back(words[body].text);
    body = std::min(body + 1, words.size());
  }
  macro.body.assign(words.begin() + body, words.end());
  for (KernelToken& word : macro.body) word.line = token.line;
  const auto known = macros_.find(name);
  if (known != macros_.end() && known->second.is_kept) {
    const auto same = [](const KernelToken& a, const KernelToken& b) { return a.text == b.text; };
    if (std::ranges::equal(macro.body, known->second.body, same)) return;
  } else {
    // A macro that is defined twice cannot keep its name in the program.
    macro.is_kept = defined_.insert(name).second && known == macros_.end() && may_stay(name, macro);
  }
  if (macro.is_kept) out_.push_back(token);
  macros_[name] = std::move(macro);
}

bool KernelPreprocessor::may_stay(const std::string& name, const Macro& macro) const {
  const KernelTokenList& body = macro.body;
  if (vocabulary_.names.contains(name) || vocabulary_.statements.contains(name) ||
      vocabulary_.values.contains(name))
    return false;
  if (!macro.is_function)
    return (body.size() == 1 && body[0].kind == Kind::kNumber) ||
           (body.size() == 2 && body[0].is("-") && body[1].kind == Kind::kNumber);
  bool has_statement = false;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const KernelToken& token = body[i];
    has_statement = has_statement || token.is(";");
    if (token.text[0] == '#' || token.is("=") || token.is("++") || token.is("--")) return false;
    if (token.kind != Kind::kName) continue;
    if (i + 1 < body.size() && body[i + 1].is("(")) {
      // A number is converted to the type of the operand that it becomes, where its own type is known.
      if (token.text.starts_with("scamp5_") || token.text.find("blur") != std::string::npos) return false;
      continue;
    }
    if (std::ranges::find(macro.parameters, token.text) != macro.parameters.end()) {
      const bool is_operand = i > 0 && i + 1 < body.size() && (body[i - 1].is("(") || body[i - 1].is(",")) &&
                              (body[i + 1].is(")") || body[i + 1].is(","));
      if (!is_operand) return false;
      continue;
    }
    const auto other = macros_.find(token.text);
    const bool is_constant = other != macros_.end() && other->second.is_kept && !other->second.is_function;
    if (!is_constant && !vocabulary_.names.contains(token.text)) return false;
  }
  return has_statement;
}

KernelTokenList KernelPreprocessor::expand_all(const KernelTokenList& in, const Names& hidden) {
  KernelTokenList out;
  for (std::size_t i = 0; i < in.size();) expand(in, i, hidden, out);
  return out;
}

void KernelPreprocessor::expand(const KernelTokenList& in, std::size_t& i, const Names& hidden,
                                KernelTokenList& out) {
  const KernelToken& token = in[i++];
  const auto found = token.kind == Kind::kName ? macros_.find(token.text) : macros_.end();
  const bool is_too_much = hidden.size() > kMaxDepth || expanded_ > kMaxExpanded;
  if (found == macros_.end() || hidden.contains(token.text) || is_too_much) {
    if (found != macros_.end() && is_too_much)
      refuse(token, fmt::format("macros are nested more than {} deep or expand to more than {} words",
                                kMaxDepth, kMaxExpanded));
    out.push_back(token);
    return;
  }
  const Macro macro = found->second;
  Names inner = hidden;
  inner.insert(token.text);
  if (!macro.is_function) {
    if (macro.is_kept) {
      out.push_back(token);
      return;
    }
    for (KernelToken& word : expand_all(substitute(macro, {}, hidden, token), inner))
      out.push_back(std::move(word));
    return;
  }
  if (i >= in.size() || !in[i].is("(")) {
    out.push_back(token);
    return;
  }
  const std::size_t end = behind_bracket(in, i);
  const std::vector<KernelTokenList> arguments = split_arguments(in, i + 1, end - 1);
  // A number is converted to the type of the operand that it becomes.
  const bool is_plain = std::ranges::all_of(arguments, [&](const KernelTokenList& argument) {
    return argument.size() == 1 && argument[0].kind == Kind::kName && !macros_.contains(argument[0].text);
  });
  if ((macro.is_kept && is_plain) || arguments.size() != macro.parameters.size()) {
    out.push_back(token);
    return;
  }
  i = end;
  for (KernelToken& word : expand_all(substitute(macro, arguments, hidden, token), inner))
    out.push_back(std::move(word));
}

KernelTokenList KernelPreprocessor::substitute(const Macro& macro,
                                               const std::vector<KernelTokenList>& arguments,
                                               const Names& hidden, const KernelToken& call) {
  const auto argument_of = [&](const KernelToken& word) -> const KernelTokenList* {
    const auto at = std::ranges::find(macro.parameters, word.text);
    if (word.kind != Kind::kName || at == macro.parameters.end()) return nullptr;
    const std::size_t index = at - macro.parameters.begin();
    return index < arguments.size() ? &arguments[index] : nullptr;
  };
  KernelTokenList out;
  bool pastes = false;
  for (std::size_t i = 0; i < macro.body.size(); ++i) {
    const KernelToken& word = macro.body[i];
    if (word.is("##")) {
      pastes = true;
      continue;
    }
    KernelTokenList words{word};
    if (word.is("#") && i + 1 < macro.body.size() && argument_of(macro.body[i + 1]) != nullptr) {
      std::string text;
      for (const KernelToken& part : *argument_of(macro.body[++i])) text += part.text;
      words = {{Kind::kString, text, word.line, word.file}};
    } else if (const KernelTokenList* argument = argument_of(word)) {
      const bool is_pasted = pastes || (i + 1 < macro.body.size() && macro.body[i + 1].is("##"));
      words = is_pasted ? *argument : expand_all(*argument, hidden);
      if (!is_pasted && makes_words(macro)) words = without_names(words);
    }
    if ((expanded_ += words.size()) > kMaxExpanded) {
      refuse(call, fmt::format("macros are nested more than {} deep or expand to more than {} words",
                               kMaxDepth, kMaxExpanded));
      break;
    }
    for (KernelToken& part : words) {
      part.line = call.line;
      part.file = call.file;
      if (std::exchange(pastes, false) && !out.empty())
        out.back() = pasted(out.back(), part);
      else
        out.push_back(std::move(part));
    }
  }
  return out;
}

}  // namespace apron::run
