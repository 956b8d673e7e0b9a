# A sweep on a cluster, by Snakemake: part K of N is `twofold sweep ... --shard K/N --resume`, then the parts are merged.
#
#     snakemake -s cluster/sweep.smk --executor slurm --slurm-array-jobs=part --jobs 500 --retries 10 --rerun-incomplete \
#         --config parts=1000 out=map.parquet sweep="--t-end 2e5 --over params.alpha=1e-3..1:log:1000 ..."
#
# The outputs that Snakemake knows of are marks. It removes the outputs of a job that failed, and rows must not be lost: the next try goes on
# with them, and has nothing to do if they are all there. (It may be called failed for nothing: in an array each task also waits for the
# mark of the array's first one.)

OUT = config["out"]
PARTS = int(config["parts"])
TWOFOLD = config.get("twofold", "twofold")


localrules:
    merge,


rule merge:
    input:
        expand("{out}.parts/{k}.done", out=OUT, k=range(1, PARTS + 1)),
    output:
        OUT,
    params:
        twofold=TWOFOLD,
        parts=expand("{out}.parts/{k}.parquet", out=OUT, k=range(1, PARTS + 1)),
    shell:
        # Code 3: some rows are failed runs. They are rows that say why.
        "{params.twofold} sweep merge {params.parts} --out {output} || [ $? -eq 3 ]"


rule part:
    output:
        touch(OUT + ".parts/{k}.done"),
    params:
        part=OUT + ".parts/{k}.parquet",
        twofold=TWOFOLD,
        sweep=config["sweep"],
        parts=PARTS,
    threads: 1
    resources:
        mem_mb=int(config.get("mem_mb", 500)),
        runtime=int(config.get("minutes", 60)),
    shell:
        "{params.twofold} sweep {params.sweep} --shard {wildcards.k}/{params.parts} --resume --threads 1 --quiet --out {params.part}"
        " || [ $? -eq 3 ]"
