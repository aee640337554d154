#pragma once
// Random values of a scenario. In the place of any value may stand
//   {uniform: [a, b]}            a number in [a, b]
//   {uniform: [a, b], step: s}   one of a, a + s, ... up to b, each as likely
//   {normal: [m, s]}             a number of mean m and standard deviation s
//   {choice: [v1, v2, ...]}      one of these, each as likely: numbers, words, lists or mappings, in which random
//   values
//                                may stand again
// Each is drawn by the run's seed and by its own path in the document (as pushes[1].time), nothing else: one more
// changes no other.
#include <cstdint>
#include <string>
#include <vector>

namespace stance::sim {

struct DrawnValue {
  std::string path;   ///< entries of lists count from 1; within a choice, as friction.choice[2]
  std::string value;  ///< what was drawn; choice[i] where that is a list or a mapping
};

struct DrawnText {
  std::string text;                ///< the document as given where nothing in it is random
  std::vector<DrawnValue> values;  ///< in the document's order
};

/// `text` with each random value replaced by what `seed` draws, and the document as given below it, as a comment. Drawn
/// again, by whatever seed, the result stays as it is. `name` stands in messages (a file's name). Throws
/// config::ConfigError naming `name`, the path and the remedy.
DrawnText draw_random_values(const std::string& text, const std::string& name, std::uint64_t seed);

}  // namespace stance::sim
