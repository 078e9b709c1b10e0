defmodule Swarm.Replacement.OrderTest do
  use ExUnit.Case, async: true
  alias Swarm.Replacement.Order
  doctest Order

  @key :crypto.strong_rand_bytes(32)

  defp new(fields \\ []) do
    struct!(
      %Order{
        id: :crypto.strong_rand_bytes(16),
        from: "base@lab",
        to: ["mag1", "mag2"],
        mission: "Elixir.Ours.Gather",
        options: Order.encode_options(radius: 2)
      },
      fields
    )
  end

  test "an order is what it was, and names no atom that is not known" do
    order = new()
    {:ok, content} = Order.encode(order)
    assert Order.decode(content) == {:ok, order}
    assert Order.options(order) == {:ok, [radius: 2]}

    name = "unknown_#{System.unique_integer([:positive])}_to_anybody"
    # {name, 1} in a list, with an atom of the external format that nobody has.
    strange = <<131, 108, 1::32, 104, 2, 119, byte_size(name), name::binary, 97, 1, 106>>
    assert Order.options(new(options: strange)) == :error
    assert Order.decode(strange) == :error
    assert_raise ArgumentError, fn -> String.to_existing_atom(name) end
  end

  test "junk is no order" do
    {:ok, content} = Order.encode(new())

    for wrong <- [
          [from: ""],
          [from: :base],
          [to: "mag1"],
          [to: [:mag1]],
          [id: "short"],
          [mission: String.duplicate("a", 256)],
          [options: 1]
        ] do
      order = new(wrong)
      term = {2, order.id, order.from, order.to, order.mission, order.options}
      assert {wrong, Order.decode(:erlang.term_to_binary(term))} == {wrong, :error}
    end

    for options <- [1, [:a], [{"a", 1}]],
        do: assert(Order.options(new(options: :erlang.term_to_binary(options))) == :error)

    for _ <- 1..500 do
      at = :rand.uniform(byte_size(content)) - 1
      <<before::binary-size(at), byte, rest::binary>> = content
      other = Bitwise.bxor(byte, :rand.uniform(255))

      case Order.decode(<<before::binary, other, rest::binary>>) do
        {:ok, %Order{}} -> :ok
        :error -> :ok
      end
    end
  end

  test "what is too large says so, and unpacks to nothing" do
    zeros = Order.encode_options(radius: :binary.copy(<<0>>, 2_048_000))

    assert Order.encode(new(options: zeros)) ==
             {:error, "options: expected data of at most 64 kB, without processes and functions"}

    order = new(options: zeros)
    term = {2, order.id, order.from, order.to, order.mission, order.options}
    assert Order.decode(:erlang.term_to_binary(term, [:compressed])) == :error
  end

  test "what is signed differs by robot, time and content, and only the whole signature is one" do
    {:ok, content} = Order.encode(new())
    bytes = Order.signed_bytes(:mag1, {7, 1_000}, content)

    others = [
      Order.signed_bytes(:mag2, {7, 1_000}, content),
      Order.signed_bytes(:mag1, {8, 1_000}, content),
      Order.signed_bytes(:mag1, {7, 1_001}, content),
      Order.signed_bytes(:mag1, {:asked, 1_000}, content),
      Order.signed_bytes(:mag1, {7, 1_000}, content <> "a")
    ]

    assert length(Enum.uniq([bytes | others])) == 6
    mac = :crypto.mac(:hmac, :sha256, @key, bytes)
    assert Order.same?(mac, mac)
    other = :crypto.mac(:hmac, :sha256, @key, hd(others))

    for wrong <- [other, nil, "", binary_part(mac, 0, 31), mac <> "a", 7, <<1::1>>],
        do: refute(Order.same?(mac, wrong))
  end
end
