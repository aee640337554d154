# Adds each peer to bench_force_qp: its source or libraries are third party's, built as its authors build them (-O3) for
# this machine (-march=native: the engines choose their path at run time, the peers when they are compiled).
set(peer_flags -O3 -march=native)

file(GLOB daqp_sources "${STANCE_BENCH_PEERS}/daqp/csrc/src/*.c")
add_library(bench_daqp STATIC EXCLUDE_FROM_ALL ${daqp_sources})
target_include_directories(bench_daqp SYSTEM PUBLIC "${STANCE_BENCH_PEERS}/daqp/csrc/include")
target_compile_options(bench_daqp PRIVATE ${peer_flags} -w)
target_sources(bench_force_qp PRIVATE force_qp/daqp.cpp)
target_link_libraries(bench_force_qp PRIVATE bench_daqp)
target_compile_definitions(bench_force_qp PRIVATE STANCE_BENCH_DAQP)
