// A nuisance of an experiment: a quantity that each episode draws, declared by vary{} or --vary.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace smartsurf::scene {

struct Variation {
  enum class Mode {
    kAbsolute,  // the number takes the declared value's place
    kFactor,    // it multiplies the declared value
    kOffset,    // it is added to the declared value
  };
  std::string name = {};         // a nuisance or a parameter (docs/experiments.md)
  double low = 0.0, high = 0.0;  // uniform in [low, high); of whole numbers, in [low, high]
  Mode mode = Mode::kAbsolute;
  std::string subject = {};          // what declares it, for messages: "a.lua:3: vary.friction"
  std::optional<double> drawn = {};  // of this episode; nullopt before it starts
};

// "absolute", "factor", "offset".
std::string_view name_of(Variation::Mode);
std::optional<Variation::Mode> find_variation_mode(std::string_view name);

// "0.5:1.5:factor"; the mode is left out if absolute, the second end if equal to the first.
std::string to_text(const Variation&);
// Reads that form: VALUE, LOW:HIGH, either with :MODE. Throws InputError that begins with the subject.
Variation parse_variation(std::string name, std::string_view text, std::string subject);
// "" or one clause: the ends must be finite and ordered.
std::string validate(const Variation&);

}  // namespace smartsurf::scene
