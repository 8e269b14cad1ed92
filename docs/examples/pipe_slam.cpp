// SPDX-License-Identifier: Apache-2.0
// The least that joins mobilia's pipe in C++: it believes the wheels. The protocol is described in
// docs/bring_your_own.md. A real system brings a JSON library; this one finds what it needs by name.
//
//     g++ -O2 -std=c++17 docs/examples/pipe_slam.cpp -o pipe_slam
//     mobilia run "pipe:./pipe_slam" --scene arena
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

// The text after "key": in a line of mobilia's.
static const char *after(const std::string &line, const std::string &key) {
  const auto at = line.find("\"" + key + "\":");
  return at == std::string::npos ? nullptr : line.c_str() + at + key.size() + 3;
}

static std::vector<double> numbers(const std::string &line, const std::string &key) {
  std::vector<double> values;
  const char *text = after(line, key);
  if (!text || *text != '[') return values;
  while (*text != ']') {
    char *end;
    values.push_back(std::strtod(text + 1, &end));
    text = end;  // at a comma or the closing bracket
  }
  return values;
}

int main() {
  std::vector<double> first;  // T_odom_robot of the first frame: the origin of the map
  for (std::string line; std::getline(std::cin, line);) {
    const std::string type = after(line, "type");
    if (type.rfind("\"hello\"", 0) == 0) {
      std::puts(R"({"type":"hello","protocol":"mobilia-slam","version":1})");
    } else if (type.rfind("\"reset\"", 0) == 0) {
      first.clear();
      std::puts(R"({"type":"reset"})");
    } else if (type.rfind("\"frame\"", 0) == 0) {
      const auto wheels = numbers(line, "T_odom_robot");  // and numbers(line, "ranges")
      if (first.empty()) first = wheels;
      const double dx = wheels[0] - first[0], dy = wheels[1] - first[1];
      const double c = std::cos(first[2]), s = std::sin(first[2]);
      const long long stamp_ns = std::atoll(after(line, "stamp_ns"));
      std::printf(R"({"type":"estimate","stamp_ns":%lld,"T_map_robot":[%.17g,%.17g,%.17g]})" "\n",
                  stamp_ns, c * dx + s * dy, c * dy - s * dx,
                  std::remainder(wheels[2] - first[2], 2.0 * M_PI));
    } else {  // bye
      break;
    }
    std::fflush(stdout);  // an answer in a buffer is no answer
  }
}
