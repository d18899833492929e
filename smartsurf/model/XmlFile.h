// An XML file whose elements report errors with file and line. Internal to this module.
#pragma once

#include <tinyxml2.h>

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/model/Model.h"

namespace smartsurf::model {

// An element of a file that outlives it.
class Element {
 public:
  Element(const tinyxml2::XMLElement* element, const std::string* file) : element_(element), file_(file) {}
  explicit operator bool() const { return element_ != nullptr; }

  std::string tag() const { return element_->Name(); }
  bool is(const char* tag) const { return tag == std::string_view(element_->Name()); }
  // "FILE:LINE: <tag name='…'>"
  std::string where() const;
  // Throws scene::InputError, "FILE:LINE: <tag name='…'>: CLAUSE".
  [[noreturn]] void refuse(const std::string& clause) const;
  // Likewise, of the attribute's value: "…: attribute='value': RULE".
  [[noreturn]] void refuse_value(const char* attribute, const std::string& rule) const;

  // The first child of that tag; false if there is none.
  Element child(const char* tag) const { return {element_->FirstChildElement(tag), file_}; }
  Element required_child(const char* tag) const;
  std::vector<Element> children(const char* tag = nullptr) const;

  bool has(const char* attribute) const { return element_->Attribute(attribute) != nullptr; }
  // The attribute in one line; "" if absent.
  std::string text(const char* attribute) const;
  std::string required_text(const char* attribute) const;
  // 1 … `most` finite numbers, at least `least`.
  std::vector<double> numbers(const char* attribute, std::size_t least, std::size_t most) const;
  double number(const char* attribute) const { return numbers(attribute, 1, 1)[0]; }
  double number(const char* attribute, double otherwise) const {
    return has(attribute) ? number(attribute) : otherwise;
  }
  // A number not below 0; 0 if absent.
  double magnitude(const char* attribute) const;
  Eigen::Vector3d vector(const char* attribute, const Eigen::Vector3d& otherwise) const;
  // The attribute `scale`, three equal numbers greater than 0; 1 if absent.
  double uniform_scale() const;

 private:
  const tinyxml2::XMLElement* element_;
  const std::string* file_;
};

// Parses `text`. The root element must have the tag.
class XmlFile {
 public:
  XmlFile(const std::string& text, std::string file, const char* root_tag);
  Element root() const { return {document_.RootElement(), &file_}; }

 private:
  std::string file_;
  tinyxml2::XMLDocument document_;
};

}  // namespace smartsurf::model
