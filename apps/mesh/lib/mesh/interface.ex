defmodule Mesh.Interface do
  @moduledoc """
  Decides which of a machine's addresses a node uses, by its option `interface`: an address, the name of a network card, or all
  (`{0, 0, 0, 0}`). Pure, but for `machine/0`, which says what the machine has now.

  All are the IPv4 addresses of all cards that are up, or that of the loopback where there is no other. An address and
  a card may be absent for a while; the node waits for them. A card that has several addresses is used by the first.
  """

  @all {0, 0, 0, 0}

  @type t :: :inet.ip4_address() | (card :: String.t())
  @typedoc "The cards of a machine: their names, their flags, of which `:up`, `:running` and `:loopback` count, their addresses."
  @type machine :: [{name :: String.t(), flags :: [atom()], [:inet.ip4_address()]}]

  @doc "What this machine has now."
  @spec machine() :: {:ok, machine()} | {:error, term()}
  # That of `:inet` says of a card without a cable that it runs.
  def machine, do: with({:ok, rows} <- :net.getifaddrs(:all), do: {:ok, cards(rows)})

  @doc "The same; a machine that does not tell has nothing."
  @spec machine_or_none() :: machine()
  def machine_or_none,
    do: with({:ok, machine} <- machine(), do: machine, else: ({:error, _reason} -> []))

  defp cards(rows) do
    names = rows |> Enum.map(& &1.name) |> Enum.uniq()

    for name <- names, own = Enum.filter(rows, &(&1.name == name)) do
      ips = for %{addr: %{family: :inet, addr: ip}} <- own, do: ip
      {List.to_string(name), hd(own).flags, ips}
    end
  end

  @doc """
  Reads what a person writes. Text of digits and dots is an address and nothing else.

      iex> for text <- ["10.0.0.7", "wlan0", "eth0.100"], do: Mesh.Interface.read(text)
      [{:ok, {10, 0, 0, 7}}, {:ok, "wlan0"}, {:ok, "eth0.100"}]
      iex> for text <- ["300.1.2.3", "10.0.0.7/24", "fe80::1", "two words", ""], do: Mesh.Interface.read(text)
      [:error, :error, :error, :error, :error]
  """
  @spec read(term()) :: {:ok, t()} | :error
  def read({a, b, c, d} = ip) when a in 0..255 and b in 0..255 and c in 0..255 and d in 0..255,
    do: {:ok, ip}

  def read(text) when is_binary(text) do
    cond do
      text =~ ~r/\A[0-9.]{1,15}\z/ ->
        with {:error, _reason} <- :inet.parse_ipv4strict_address(String.to_charlist(text)),
             do: :error

      # As Linux names them, without the characters of shells.
      text =~ ~r/\A[A-Za-z0-9][A-Za-z0-9_.@-]{0,14}\z/ ->
        {:ok, text}

      true ->
        :error
    end
  end

  def read(_other), do: :error

  @doc "That of the environment, `CONVOY_INTERFACE`; all addresses if it names none."
  @spec of_environment() :: t()
  def of_environment do
    case read(to_string(:os.getenv(~c"CONVOY_INTERFACE", ~c""))) do
      {:ok, interface} -> interface
      :error -> {0, 0, 0, 0}
    end
  end

  @doc "What `read/1` accepts, in words."
  @spec allowed() :: String.t()
  def allowed,
    do: ~s(an IPv4 address such as "10.0.0.7", or the name of a network card such as "wlan0",)

  @doc "The same as text."
  @spec text(t()) :: String.t()
  def text(card) when is_binary(card), do: card
  def text(ip), do: ip |> :inet.ntoa() |> List.to_string()

  @doc """
  The addresses to join the multicast group by and to send from now; none while what it waits for is absent.

      iex> lo = {"lo", [:up, :loopback, :running], [{127, 0, 0, 1}]}
      iex> eth0 = {"eth0", [:up, :running], [{10, 0, 0, 7}, {10, 0, 1, 7}]}
      iex> for interface <- [{0, 0, 0, 0}, {10, 0, 1, 7}, "eth0", "wlan0"],
      ...>   do: Mesh.Interface.addresses(interface, [lo, eth0])
      [[{10, 0, 0, 7}, {10, 0, 1, 7}], [{10, 0, 1, 7}], [{10, 0, 0, 7}], []]
      iex> Mesh.Interface.addresses({0, 0, 0, 0}, [lo])
      [{127, 0, 0, 1}]
  """
  @spec addresses(t(), machine()) :: [:inet.ip4_address()]
  def addresses(@all, machine) do
    {loopback, others} = machine |> Enum.filter(&up?/1) |> Enum.split_with(&loopback?/1)
    with [] <- Enum.flat_map(others, &ips/1), do: Enum.flat_map(loopback, &ips/1)
  end

  def addresses(ip, machine) when is_tuple(ip) do
    there? = Enum.any?(machine, &(up?(&1) and has?(&1, ip)))
    if there?, do: [ip], else: []
  end

  def addresses(card, machine) do
    with about when about != nil <- find(machine, card),
         true <- up?(about),
         do: about |> ips() |> Enum.take(1),
         else: (_absent_or_down -> [])
  end

  @doc "All IPv4 addresses of a machine, those of the loopback last."
  @spec all(machine()) :: [:inet.ip4_address()]
  def all(machine) do
    {loopback, others} = Enum.split_with(machine, &loopback?/1)
    Enum.flat_map(others ++ loopback, &ips/1)
  end

  @doc """
  Whether a connection that was made to this address of the machine was made to the interface. The loopback always is:
  only the machine itself can call it.
  """
  @spec called?(t(), :inet.ip_address(), (... -> machine())) :: boolean()
  def called?(@all, _ip, _machine), do: true
  def called?(_interface, {127, _, _, _}, _machine), do: true
  def called?(ip, called, _machine) when is_tuple(ip), do: ip == called

  def called?(card, called, machine),
    do: Enum.any?(machine.(), &(name(&1) == card and has?(&1, called)))

  @doc """
  Why no node can be reached by it, on one line; `nil` if there is no reason in the machine itself.

      iex> lo = {"lo", [:up, :loopback, :running], [{127, 0, 0, 1}]}
      iex> eth0 = {"eth0", [:up], [{10, 0, 0, 7}]}
      iex> for interface <- [{0, 0, 0, 0}, {10, 0, 0, 9}, "eth0", "wlan0", {127, 0, 0, 1}],
      ...>   do: Mesh.Interface.trouble(interface, [lo, eth0])
      ["eth0 is not connected", "waits for 10.0.0.9, which no card has; there are eth0 10.0.0.7, lo 127.0.0.1",
       "eth0 is not connected", "waits for wlan0, which is no card of this machine; there are eth0, lo", nil]
      iex> Mesh.Interface.trouble({0, 0, 0, 0}, [lo])
      "no network card is up and has an IPv4 address"
  """
  @spec trouble(t(), machine()) :: String.t() | nil
  def trouble(interface, machine) do
    used = addresses(interface, machine)
    cards = Enum.filter(machine, fn card -> up?(card) and Enum.any?(used, &has?(card, &1)) end)

    cond do
      cards == [] or (interface == @all and Enum.all?(cards, &loopback?/1)) ->
        missing(interface, machine)

      Enum.any?(cards, &flag?(&1, :running)) ->
        nil

      true ->
        "#{Enum.map_join(cards, ", ", &name/1)} is not connected"
    end
  end

  defp missing(@all, _machine), do: "no network card is up and has an IPv4 address"

  defp missing(ip, machine) when is_tuple(ip) do
    case Enum.find(machine, &has?(&1, ip)) do
      nil ->
        there = for card <- Enum.sort(machine), ip <- ips(card), do: "#{name(card)} #{text(ip)}"
        "waits for #{text(ip)}, which no card has; there are #{Enum.join(there, ", ")}"

      card ->
        "waits for #{text(ip)}, whose card #{name(card)} is down"
    end
  end

  defp missing(card, machine) do
    case find(machine, card) do
      nil ->
        there = machine |> Enum.map(&name/1) |> Enum.sort() |> Enum.join(", ")
        "waits for #{card}, which is no card of this machine; there are #{there}"

      about ->
        "waits for #{card}, which #{if up?(about), do: "has no IPv4 address", else: "is down"}"
    end
  end

  defp find(machine, card), do: Enum.find(machine, &(name(&1) == card))
  defp name({name, _flags, _ips}), do: name
  defp ips({_name, _flags, ips}), do: ips
  defp has?(card, ip), do: ip in ips(card)
  defp up?(card), do: flag?(card, :up)
  defp loopback?(card), do: flag?(card, :loopback)
  defp flag?({_name, flags, _ips}, flag), do: flag in flags
end
