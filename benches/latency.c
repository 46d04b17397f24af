/* Latency and time per byte of messages between ranks 0 and 1, for the model of docs/scaling.md:
 *     mpicc -O2 benches/latency.c -o latency && mpirun -n 2 ./latency
 */
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>

static double one_way(int rank, char *buffer, int bytes, int rounds) {
    MPI_Barrier(MPI_COMM_WORLD);
    double began = MPI_Wtime();
    for (int k = 0; k < rounds; k++) {
        if (rank == 0) {
            MPI_Send(buffer, bytes, MPI_BYTE, 1, 0, MPI_COMM_WORLD);
            MPI_Recv(buffer, bytes, MPI_BYTE, 1, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        } else if (rank == 1) {
            MPI_Recv(buffer, bytes, MPI_BYTE, 0, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
            MPI_Send(buffer, bytes, MPI_BYTE, 0, 0, MPI_COMM_WORLD);
        }
    }
    return (MPI_Wtime() - began) / (2.0 * rounds);
}

int main(int argc, char **argv) {
    int rank;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    char *buffer = calloc(1 << 24, 1);
    one_way(rank, buffer, 8, 1000);
    double latency = one_way(rank, buffer, 8, 20000);
    double large = one_way(rank, buffer, 1 << 24, 50);
    if (rank == 0) {
        printf("latency %.2e s, time per byte %.2e s\n", latency, (large - latency) / (1 << 24));
    }
    free(buffer);
    MPI_Finalize();
    return 0;
}
