defmodule Mcap.FoxgloveTest do
  use ExUnit.Case, async: true
  alias Mcap.Foxglove.{Encode, Schemas}
  alias Mcap.{Json, Payloads}
  doctest Mcap.Foxglove
  doctest Mcap.Foxglove.Encode
  doctest Mcap.Foxglove.Schemas

  test "each payload is what its schema says, field for field, and each schema has one" do
    payloads = Payloads.all(1_700_000_000_123_456_789)

    for {name, payload} <- payloads,
        schema = Json.decode!(Schemas.text(name)),
        do: assert({name, []} == {name, Json.problems(Json.decode!(payload), schema)})

    assert payloads |> Enum.map(&elem(&1, 0)) |> Enum.uniq() |> Enum.sort() == Schemas.names()
  end

  test "the judge of these tests sees what is missing, and what is of another type" do
    schema = Json.decode!(Schemas.text("foxglove.PoseInFrame"))
    good = IO.iodata_to_binary(Mcap.Foxglove.pose_in_frame(1, "map", Hal.Pose.new(0, 0)))

    for {part, other} <- [
          {~s("frame_id":"map"), ~s("frame":"map")},
          {~s("map"), "1"},
          {~s("x":0.0), ~s("x":"0")},
          {~s(,"w":1.0), ""}
        ] do
      bad = String.replace(good, part, other)
      assert bad != good
      assert Json.problems(Json.decode!(bad), schema) != []
    end
  end

  test "schemas are what viewers' parsers take: one type each, items of one type, no references" do
    for name <- Schemas.names() do
      text = Schemas.text(name)
      assert {name, plain(Json.decode!(text))} == {name, []}
      assert {:object, [{"title", ^name}, {"type", "object"} | _]} = Json.decode!(text)
      refute text =~ "$ref"
    end
  end

  # A choice is a list of numbers, an array's item is no array.
  defp plain({:object, pairs}) do
    case Map.new(pairs) do
      %{"oneOf" => choices} ->
        for {:object, [{"title", t}, {"const", c}]} <- choices,
            not (is_binary(t) and is_integer(c)),
            do: t

      %{"type" => "object", "properties" => {:object, fields}} ->
        Enum.flat_map(fields, fn {_key, schema} -> plain(schema) end)

      %{"type" => "array", "items" => {:object, items} = schema} ->
        if {"type", "array"} in items, do: [schema], else: plain(schema)

      %{"type" => type} ->
        if type in ["string", "number", "integer", "boolean"], do: [], else: [type]
    end
  end

  test "a name that is not there is one line" do
    assert_raise ArgumentError,
                 ~r/^no schema "foxglove.Lgo": there are .*; did you mean foxglove.Log\?$/,
                 fn ->
                   Mcap.Foxglove.schema("foxglove.Lgo")
                 end
  end

  test "floats read back the same" do
    {floats, _} =
      Enum.map_reduce(1..1000, :rand.seed_s(:exsss, 3), fn _n, state ->
        {bits, state} = :rand.uniform_s(0x7FEF_FFFF_FFFF_FFFF, state)
        <<float::float>> = <<bits::64>>
        {float, state}
      end)

    for float <- [0.0, -1.0e-300, 1.0e22 | floats],
        do: assert(Json.decode!(Encode.number(float)) == float)
  end
end
