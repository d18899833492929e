// The words of a command, as exec() takes them.
#pragma once

#include <string>
#include <vector>

namespace common {

// Pointers to the words, then null. They are valid as long as the words.
inline std::vector<char*> argument_pointers(const std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (const std::string& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace common
