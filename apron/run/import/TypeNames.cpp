#include "apron/run/import/TypeNames.h"

#include <map>
#include <string>
#include <utility>

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

// `unsigned char` and its kin as one word, so that byte(x) remains a conversion.
KernelTokenList one_word(KernelTokenList type) {
  static const std::map<std::string, std::string> kWords = {{"unsigned char", "uint8_t"},
                                                            {"signed char", "int8_t"},
                                                            {"unsigned short", "uint16_t"},
                                                            {"unsigned int", "uint32_t"},
                                                            {"unsigned long", "uint32_t"}};
  if (type.size() != 2) return type;
  const auto found = kWords.find(type[0].text + " " + type[1].text);
  if (found == kWords.end()) return type;
  type.pop_back();
  type.front().text = found->second;
  return type;
}

}  // namespace

KernelTokenList without_aliases(const KernelTokenList& tokens) {
  std::map<std::string, KernelTokenList> aliases;
  KernelTokenList out;
  const auto add = [&](KernelTokenList& list, std::size_t i) {
    const auto alias = aliases.find(tokens[i].text);
    const bool is_member = i > 0 && (tokens[i - 1].is(".") || tokens[i - 1].is("->"));
    const bool is_scope = i + 1 < tokens.size() && tokens[i + 1].is("::");
    if (tokens[i].kind != Kind::kName || is_member || is_scope || alias == aliases.end())
      return list.push_back(tokens[i]);
    for (KernelToken word : alias->second) {
      word.line = tokens[i].line;
      word.file = tokens[i].file;
      list.push_back(std::move(word));
    }
  };
  const auto stays = [](const KernelToken& token) {
    return token.opens_bracket() || token.is("<") || token.kind == Kind::kDirective ||
           token.is_name_of({"struct", "class", "union", "enum", "typename", "decltype"});
  };
  // Takes `enum` at i: of a definition all before its '{', in `enum Mode m` the word. Returns the last token
  // taken.
  const auto take_enum = [&](std::size_t i) {
    std::size_t name = i + 1;
    if (name < tokens.size() && tokens[name].is_name_of({"class", "struct"})) ++name;
    std::size_t k = name;
    if (k < tokens.size() && tokens[k].kind == Kind::kName) ++k;
    KernelTokenList type;
    if (k < tokens.size() && tokens[k].is(":"))
      for (++k; k < tokens.size() && !tokens[k].is("{") && !tokens[k].is(";"); ++k) add(type, k);
    if (k >= tokens.size() || (!tokens[k].is("{") && !tokens[k].is(";"))) return i;
    if (type.empty()) {
      type = {tokens[i]};
      type.front().text = "int";
    }
    type = one_word(std::move(type));
    if (tokens[name].kind == Kind::kName) aliases[tokens[name].text] = type;
    std::size_t end = k;
    if (!out.empty() && out.back().is_name("typedef") && tokens[k].is("{")) {
      out.pop_back();
      end = behind_bracket(tokens, k);
      if (end < tokens.size() && tokens[end].kind == Kind::kName) aliases[tokens[end].text] = type;
    }
    out.insert(out.end(), tokens.begin() + i, tokens.begin() + end);
    return end > k ? end : end - 1;
  };
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    if (tokens[i].is_name("enum")) {
      i = take_enum(i);
      continue;
    }
    const bool is_typedef = tokens[i].is_name("typedef");
    const bool is_using = tokens[i].is_name("using") && i + 2 < tokens.size() && tokens[i + 2].is("=");
    if (is_typedef || is_using) {
      std::size_t end = i + 1;
      while (end < tokens.size() && !tokens[end].is(";") && !stays(tokens[end])) ++end;
      const std::size_t first = is_typedef ? i + 1 : i + 3, last = is_typedef ? end - 1 : end;
      if (end < tokens.size() && tokens[end].is(";") && first < last) {
        KernelTokenList type;
        for (std::size_t k = first; k < last; ++k) add(type, k);
        aliases[tokens[is_typedef ? last : i + 1].text] = one_word(std::move(type));
        i = end;
        continue;
      }
    }
    add(out, i);
  }
  return out;
}

}  // namespace apron::run
