#include "smartsurf/model/XmlFile.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "common/text/Number.h"

namespace smartsurf::model {
namespace {

constexpr std::size_t kMaxShownLength = 100, kMaxElements = 100'000, kMaxAttributes = 1000;

std::string single_line(std::string_view text) {
  std::string line(text);
  std::ranges::replace_if(
      line, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return line;
}

// For messages.
std::string shown(std::string_view text) { return single_line(text.substr(0, kMaxShownLength)); }

std::size_t count_elements(const tinyxml2::XMLElement* element) {
  std::size_t count = 1;
  for (const auto* child = element->FirstChildElement(); child; child = child->NextSiblingElement())
    count += count_elements(child);  // tinyxml2 bounds the depth
  return count;
}

// The line of the first element with too many attributes, of which the library compares each with all before
// it; 0: there is none.
std::size_t line_of_many_attributes(std::string_view text) {
  const auto after = [&](std::size_t at, std::string_view end) {
    const std::size_t found = text.find(end, at);
    return found == std::string_view::npos ? text.size() : found + end.size();
  };
  for (std::size_t begin = text.find('<'), at = begin; begin < text.size(); begin = at = text.find('<', at)) {
    if (text.substr(begin).starts_with("<!--")) {
      at = after(begin + 4, "-->");
    } else if (text.substr(begin).starts_with("<![CDATA[")) {
      at = after(begin, "]]>");
    } else {
      for (std::size_t count = 0; (at = text.find_first_of("\"'>", at)) < text.size() && text[at] != '>';
           ++count) {
        if (count == kMaxAttributes) return 1 + std::ranges::count(text.substr(0, begin), '\n');
        at = after(at + 1, text.substr(at, 1));
      }
    }
  }
  return 0;
}

}  // namespace

std::string Element::where() const {
  const std::string name = shown(text("name"));
  return *file_ + ":" + std::to_string(element_->GetLineNum()) + ": <" + shown(tag()) +
         (name.empty() ? ">" : " name='" + name + "'>");
}

void Element::refuse(const std::string& clause) const { throw scene::InputError(where() + ": " + clause); }

void Element::refuse_value(const char* attribute, const std::string& rule) const {
  refuse(std::string(attribute) + "='" + shown(text(attribute)) + "': " + rule);
}

Element Element::required_child(const char* tag) const {
  const Element found = child(tag);
  if (!found) refuse(std::string("the element <") + tag + "> is missing");
  return found;
}

std::vector<Element> Element::children(const char* tag) const {
  std::vector<Element> all;
  for (const auto* e = element_->FirstChildElement(tag); e; e = e->NextSiblingElement(tag))
    all.emplace_back(e, file_);
  return all;
}

std::string Element::text(const char* attribute) const {
  const char* const value = element_->Attribute(attribute);
  return value ? single_line(value) : "";
}

std::string Element::required_text(const char* attribute) const {
  const std::string value = text(attribute);
  if (value.empty()) refuse(std::string("the attribute '") + attribute + "' is missing");
  return value;
}

std::vector<double> Element::numbers(const char* attribute, std::size_t least, std::size_t most) const {
  const char* const value = element_->Attribute(attribute);
  if (!value) refuse(std::string("the attribute '") + attribute + "' is missing");
  constexpr std::string_view kSpace = " \t\r\n";
  std::vector<double> numbers;
  bool valid = true;
  std::string_view rest(value);
  for (rest.remove_prefix(std::min(rest.find_first_not_of(kSpace), rest.size())); valid && !rest.empty();
       rest.remove_prefix(std::min(rest.find_first_not_of(kSpace), rest.size()))) {
    std::string_view word = rest.substr(0, rest.find_first_of(kSpace));
    rest.remove_prefix(word.size());
    if (word.starts_with('+')) word.remove_prefix(1);
    double number = 0.0;
    valid = common::parse_number(word, number) && std::isfinite(number) && numbers.size() < most;
    numbers.push_back(number);
  }
  if (!valid || numbers.size() < least)
    refuse_value(attribute, "must be " + (most == 1 ? "a number"
                                                    : (least == most ? "" : std::to_string(least) + " to ") +
                                                          std::to_string(most) + " numbers"));
  return numbers;
}

double Element::magnitude(const char* attribute) const {
  const double value = number(attribute, 0.0);
  if (value < 0.0) refuse_value(attribute, "must not be below 0");
  return value;
}

Eigen::Vector3d Element::vector(const char* attribute, const Eigen::Vector3d& otherwise) const {
  if (!has(attribute)) return otherwise;
  const std::vector<double> v = numbers(attribute, 3, 3);
  return {v[0], v[1], v[2]};
}

double Element::uniform_scale() const {
  const Eigen::Vector3d scale = vector("scale", Eigen::Vector3d::Ones());
  if (scale.x() != scale.y() || scale.x() != scale.z() || !(scale.x() > 0.0))
    refuse_value("scale", "must be three times the same number greater than 0");
  return scale.x();
}

XmlFile::XmlFile(const std::string& text, std::string file, const char* root_tag) : file_(std::move(file)) {
  if (const std::size_t line = line_of_many_attributes(text); line > 0)
    throw scene::InputError(file_ + ":" + std::to_string(line) + ": an element has more than " +
                            std::to_string(kMaxAttributes) + " attributes");
  if (document_.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    const bool is_deep = document_.ErrorID() == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED;
    throw scene::InputError(
        file_ + ":" + std::to_string(document_.ErrorLineNum()) +
        (is_deep ? ": elements are nested deeper than " + std::to_string(TINYXML2_MAX_ELEMENT_DEPTH)
                 : ": is not well-formed XML (" + std::string(document_.ErrorName()) + ")"));
  }
  if (!document_.RootElement() || !root().is(root_tag))
    throw scene::InputError(
        file_ + ":" + std::to_string(document_.RootElement() ? document_.RootElement()->GetLineNum() : 1) +
        ": the first element must be <" + root_tag + ">");
  if (count_elements(document_.RootElement()) > kMaxElements)
    throw scene::InputError(file_ + ":1: has more than 100000 elements");
}

}  // namespace smartsurf::model
